"""What a program needs of a participant's page: its forms, whether it is a game, the completion code."""

from collections.abc import Mapping
from html.parser import HTMLParser
from typing import Any

Fields = dict[str, list["Field"]]


class Field:
    """One input of a form, as the page has it."""

    def __init__(self, kind: str, value: str, attributes: Mapping[str, str]) -> None:
        self.kind, self.value = kind, value
        self.low = float(attributes.get("data-low") or attributes.get("min") or 18)
        self.high = float(attributes.get("data-high") or attributes.get("max") or 99)
        self.most = int(attributes.get("data-most") or 0)
        self.is_number = kind == "number" or attributes.get("inputmode") in ("numeric", "decimal")
        self.is_required = "required" in attributes


class ParsedPage(HTMLParser):
    """The parts of a page that a participant acts on: forms, the game, the completion code."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.forms: list[tuple[str, Fields]] = []  # action, field -> its inputs
        self.faults: frozenset[str] = frozenset()  # questions whose answers came back
        self.is_game = False
        self.code: str | None = None
        self._in_code = False
        self.feed(text)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        values = {name: value or "" for name, value in attrs}
        if values.get("id") == "game-config":
            self.is_game = True
        self._in_code = tag == "output" and values.get("id") == "code"
        self._own_code = values.get("data-own", "") if self._in_code else ""
        if tag == "fieldset" and "missing" in values.get("class", "").split():
            self.faults |= {values.get("id", "").removeprefix("q-")}
        if tag == "form" and values.get("method", "").lower() == "post":
            self.forms.append((values.get("action", ""), {}))
        elif tag in ("input", "textarea", "select", "button") and values.get("name") and self.forms:
            kind = values.get("type", "text") if tag == "input" else tag
            new = Field(kind, values.get("value", ""), values)
            self.forms[-1][1].setdefault(values["name"], []).append(new)

    def handle_data(self, data: str) -> None:
        if self._in_code and data.strip():
            self.code = self._own_code or data.strip()  # a recruiter's code is everybody's

    def form(self, path: str) -> Fields | None:
        """Return the fields of the form that is sent to `path`, None if there is no such form. The server may lie
        behind a path of its own, which the address in the page begins with."""
        return next((fields for action, fields in self.forms if action.endswith(path)), None)

    def step(self, path: str) -> str:
        """The key of the step that this page is; empty for one that is none."""
        fields = self.form(path) or {}
        return fields["step"][0].value if "step" in fields else ""


def filled_in(fields: Fields, answers: Mapping[str, Any]) -> dict[str, Any]:
    """Return what a form sends: hidden fields as they are, these answers (question -> value, or a list of values), and
    the first or lowest answer to every other question. Answers to questions that the form does not have are left out.
    """
    places: dict[str, int] = {}
    sent: dict[str, Any] = {}
    for name, options in fields.items():
        question, _, option = name.partition(".")
        if options[0].kind in ("hidden", "button"):
            sent[name] = options[0].value
        elif name in answers:
            given = answers[name]
            sent[name] = [str(one) for one in given] if isinstance(given, list | tuple) else str(given)
        elif option and options[0].kind == "select":  # a ranking: every place once
            places[question] = places.get(question, 0) + 1
            sent[name] = str(places[question])
        else:
            sent[name] = _plain_answer(name, options)
    return sent


def _plain_answer(name: str, options: list[Field]) -> Any:
    values = [option.value for option in options if option.value]
    if options[0].kind == "checkbox":
        return values if name.startswith("box_") else values[:1]
    if options[0].kind == "radio" and values:
        return values[0]
    if options[0].kind == "select":
        return values[0] if values else "1"
    return f"{options[0].low:g}" if options[0].is_number else "-"
