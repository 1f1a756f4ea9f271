"""Check that the factors of a study file fit together, and map problems of conditions to the levels that set them.
Pure.
"""

from collections.abc import Iterable, Iterator
from dataclasses import replace

from server.study.checks import Path, Problem
from server.study.definition import Study
from server.study.factors import crossed, set_by


def factor_problems(study: Study) -> Iterator[Problem]:
    """Yield everything wrong with the factors of a study whose single values are valid."""
    if not study.factors:
        if "cells" in study.model_fields_set:
            yield Problem(("cells",), "`cells` has no effect without `factors`", "Add `factors`, or remove it.")
        return
    owners: dict[str, str] = {}
    for factor, levels in study.factors.items():
        for level, settings in levels.items():
            for key in set_by(settings):
                if owners.setdefault(key, factor) != factor:
                    reason = f"`{key}` is set by the factors {owners[key]!r} and {factor!r}"
                    yield Problem(("factors", factor, level, key), reason, "Set it in the levels of one factor only.")
    yield from _alike(study)
    yield from _without(study)
    yield from _within(study)


def _alike(study: Study) -> Iterator[Problem]:
    """Warn of levels of a factor that change the same, such as nothing: their conditions differ in their names only."""
    for factor, levels in study.factors.items():
        first: dict[str, str] = {}  # by what a level changes: the first level that does
        for level, settings in levels.items():
            changed = settings.model_dump_json(include=set(set_by(settings)))
            other = first.setdefault(changed, level)
            if other != level:
                what = "nothing" if changed == "{}" else "the same"
                reason = f"the levels {other!r} and {level!r} change {what}: participants see the same in both"
                remedy = f"Give {level!r} a setting, such as `predictor: none`."
                yield Problem(("factors", factor, level), reason, remedy, warning=True)


def _within(study: Study) -> Iterator[Problem]:
    """Check the factors of which every participant meets all levels."""
    for index, name in enumerate(study.cells.within):
        place: Path = ("cells", "within", index)
        if name not in study.factors:
            yield Problem(place, f"there is no factor {name!r}", f"Known: {', '.join(study.factors)}.")
        if name in study.cells.within[:index]:
            yield Problem(place, f"{name!r} occurs twice", "Name each once.")
    if study.cells.within and study.cells.without:
        reason = "a participant meets all combinations of the levels in `within`, so none can be left out"
        yield Problem(("cells", "without"), reason, "Remove `without`, or remove `within`.")
    if study.cells.within and "episodes" not in study.flow:
        reason = "there are no rounds in which the levels could be met"
        yield Problem(("cells", "within"), reason, "Add `episodes` to `flow`, or remove it.")


def _without(study: Study) -> Iterator[Problem]:
    known = [name for name, _ in crossed(study.factors)]
    for index, name in enumerate(study.cells.without):
        if name not in known:
            reason = f"no combination of levels is named {name!r}"
            yield Problem(("cells", "without", index), reason, f"Known: {', '.join(known)}.")


def in_factors(study: Study, found: Iterable[Problem]) -> Iterator[Problem]:
    """Return the same problems, with those of conditions that factors make placed where a level sets the value."""
    for problem in found:
        match problem.path:
            case ("conditions", int(index), *rest) if study.factors:
                name = study.displays[index].name
                place = _place(study, name, str(rest[0]) if rest else "predictor")
                yield replace(problem, path=place, reason=f"in the condition {name}, {problem.reason}")
            case _:
                yield problem


def _place(study: Study, condition: str, key: str) -> Path:
    levels = dict(crossed(study.factors))[condition]
    for factor, level in levels.items():
        if key in set_by(study.factors[factor][level]):
            return ("factors", factor, level, key)
    return ("factors",)
