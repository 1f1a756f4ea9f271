"""Answers of a simulated participant: ratings that depend on the episode, and the other fields of a form."""

from collections.abc import Mapping
from random import Random
from typing import Any, Final

from kitchenmind.client.pages import Field, Fields
from server.bots.cook import Impression, Traits

_ABOUT_ARROWS: Final = ("predictor", "mark", "arrow")
_ABOUT_FORESIGHT: Final = ("aware", "predict", "intention")


class Respondent:
    """Fills in every page of one participant. `known`: question -> the correct answer in the study file."""

    def __init__(self, traits: Traits, known: Mapping[str, str]) -> None:
        self._traits, self._known = traits, known
        self._chance = Random(f"answers {traits.seed}")  # noqa: S311 - a seed makes a run repeatable

    def fill(self, fields: Fields, last: Impression | None, faults: frozenset[str]) -> dict[str, Any]:
        """Return an answer to every required question; `faults`: questions with an invalid answer."""
        filled: dict[str, Any] = {}
        places: dict[str, int] = {}
        for name, options in fields.items():
            question, _, option = name.partition(".")
            if option and options[0].kind == "select":
                places[question] = places.get(question, 0) + 1
                filled[name] = str(places[question])
            else:
                filled[name] = self._one(name, options, last, faults)
        return {name: value for name, value in filled.items() if value not in (None, [])}

    def _one(self, name: str, options: list[Field], last: Impression | None, faults: frozenset[str]) -> Any:
        kind, values = options[0].kind, [option.value for option in options]
        if kind in ("hidden", "button"):
            return values[0]
        if kind == "checkbox":
            return self._some(name, values)
        if kind in ("radio", "select"):
            return self._choice(name, values, last, faults)
        if options[0].is_number:
            low, high = options[0].low, min(options[0].high, options[0].low + 45)
            return str(round(self._chance.uniform(low, high)))
        return "-"

    def _some(self, name: str, values: list[str]) -> list[str]:
        """Return all boxes that must be ticked; of several options one or two."""
        if name.startswith("box_"):
            return values
        return sorted(self._chance.sample(values, self._chance.choice((1, min(2, len(values))))))

    def _choice(self, name: str, values: list[str], last: Impression | None, faults: frozenset[str]) -> str:
        if name in self._known and (name in faults or self._chance.random() < 0.9):
            return self._known[name]
        if last is not None and all(value.isdigit() for value in values):
            return values[self._rating(name, len(values), last) - 1]
        return self._chance.choice(values)

    def _rating(self, name: str, points: int, last: Impression) -> int:
        """Return 1 to `points`; on average higher if the aspect of the question went better in the episode."""
        smooth = 1 - min(1.0, 5 * last.share(last.blocked, last.tried))
        pace = min(1.0, last.soups_in_80_s / 8)
        foresight = last.share(last.right, last.predicted) if last.predicted else 0.45
        if any(word in name for word in _ABOUT_ARROWS) and "predictability" not in name:
            level = foresight
        elif any(word in name for word in _ABOUT_FORESIGHT):
            level = 0.5 * foresight + 0.3 * smooth + 0.2 * pace
        else:
            level = 0.55 * pace + 0.3 * smooth + 0.15 * foresight
        wanted = 1 + level * (points - 1) + (self._traits.mood + self._chance.gauss(0, 0.8)) * points / 7
        return max(1, min(points, round(wanted)))
