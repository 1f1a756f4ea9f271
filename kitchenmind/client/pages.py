"""Parse a participant's page for a program: its forms, whether it is a game, the completion code."""

from collections.abc import Iterator, Mapping
from html.parser import HTMLParser
from typing import Any

import msgspec

from server.play.step_types import StepField, StepPage

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
        self.has_ended_early = False  # screened out, withdrawn or out of time
        self._in_code = False
        self.feed(text)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        values = {name: value or "" for name, value in attrs}
        if values.get("id") == "game-config":
            self.is_game = True
        self.has_ended_early |= "data-ended" in values
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
            self.code = self._own_code or data.strip()  # a recruiter's code is the same for all participants

    def form(self, path: str) -> Fields | None:
        """Return the fields of the form that is sent to `path`, None if there is no such form. The server may be served
        below a path, with which the addresses in the page begin."""
        return next((fields for action, fields in self.forms if action.endswith(path)), None)

    def step(self, path: str) -> str:
        """Return the key of the page's step; empty if it is not a step."""
        fields = self.form(path) or {}
        return fields["step"][0].value if "step" in fields else ""


def page_of_json(text: str | bytes) -> ParsedPage:
    """Return the page that the server sent as JSON. Raises msgspec.DecodeError for anything else."""
    step = msgspec.json.decode(text, type=StepPage)
    page = ParsedPage("")
    page.is_game = step.game is not None
    page.has_ended_early = step.page == "ended"
    if step.end is not None:
        page.code = step.end.own_code or step.end.code or None
    if step.form is not None:
        page.forms = [(step.form.action, {name: found for one in step.form.fields for name, found in _inputs(one)})]
        page.faults = frozenset(one.name for one in step.form.fields if one.fault and one.type != "check")
    return page


def _inputs(field: StepField) -> Iterator[tuple[str, list[Field]]]:
    """Yield the inputs of one field, as an HTML form has them."""
    needed = {"required": ""} if field.required else {}
    low, high = ("" if one is None else f"{one:.15g}" for one in (field.low, field.high))
    match field.type:
        case "hidden":
            yield field.name, [Field("hidden", field.value, {})]
        case "check":
            yield field.name, [Field("checkbox", field.value, needed)]
        case "scale":
            points = range(int(field.low or 0), int(field.high or 1) + 1, field.step)
            yield field.name, [Field("radio", str(point), needed) for point in points]
        case "choice" | "multiple":
            kind = "radio" if field.type == "choice" else "checkbox"
            yield field.name, [Field(kind, option.value, needed) for option in field.options]
        case "ranking":
            for option in field.options:
                yield f"{field.name}.{option.value}", [Field("select", "", needed)]
        case "number":
            limits = {"inputmode": "numeric" if field.whole else "decimal", "data-low": low, "data-high": high}
            yield field.name, [Field("text", "", needed | limits)]
        case _:
            yield field.name, [Field("text", "", needed)]


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
