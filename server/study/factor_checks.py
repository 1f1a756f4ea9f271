"""What must fit together in the factors of a study file, and where in the file its conditions come from. Pure."""

from collections.abc import Iterable, Iterator
from dataclasses import replace

from server.study.checks import Path, Problem
from server.study.definition import Study
from server.study.factors import crossed, set_by


def factor_problems(study: Study) -> Iterator[Problem]:
    """Everything wrong with the factors of a study whose single values are right."""
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
    yield from _without(study)


def _without(study: Study) -> Iterator[Problem]:
    known = [name for name, _ in crossed(study.factors)]
    for index, name in enumerate(study.cells.without):
        if name not in known:
            reason = f"no combination of levels is named {name!r}"
            yield Problem(("cells", "without", index), reason, f"Known: {', '.join(known)}.")


def in_factors(study: Study, found: Iterable[Problem]) -> Iterator[Problem]:
    """The same problems; those of conditions that factors make are placed where a level sets the value."""
    for problem in found:
        match problem.path:
            case ("conditions", int(index), *rest) if study.factors:
                name = study.conditions[index].name
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
