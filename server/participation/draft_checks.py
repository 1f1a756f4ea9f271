"""Checks of a study that is written in the dashboard, in addition to those of a study file."""

from collections.abc import Iterator, Sequence
from functools import cache

from models.agents.blackbox import is_foreign
from models.agents.model_paths import without_variant
from overcooked.layout import layout_names
from server.prediction_warnings import prediction_warnings
from server.required_models import WEIGHTS, WITHOUT_WEIGHTS
from server.study.checks import Problem
from server.study.loader import PlacedProblem, StudyError, StudyFile
from server.study_check import models_named, stage_problems


def draft_problems(file: StudyFile, served: Sequence[StudyFile], loads: bool = False) -> list[PlacedProblem]:
    """Return everything that prevents opening the study here, and warnings. `served`: the studies from files. `loads`:
    load the models too, which takes seconds."""
    foreign = [*_taken(file, served), *_foreign(file, served)]
    if foreign:
        return [*file.placed_warnings, *map(file.places.placed, foreign)]
    try:
        found = list(stage_problems(file, loads))
        if all(problem.warning for problem in found):
            found += prediction_warnings(file)
    except StudyError as error:
        return list(error.placed) or [PlacedProblem(1, (), str(error))]
    return [*file.placed_warnings, *map(file.places.placed, found)]


def known_names(kitchens: Sequence[str] = ()) -> dict[str, list[str]]:
    """Return the layouts, agents and predictors that the form suggests. `kitchens`: those of the dashboard."""
    bundled = _bundled_names()
    return bundled | {"layouts": [*bundled["layouts"], *(name for name in kitchens if name not in bundled["layouts"])]}


@cache
def _bundled_names() -> dict[str, list[str]]:
    models = {path.parent.name for path in WEIGHTS.glob("*/*/config.json")}
    predictors = sorted(name for name in models if "_predictor_" in name)
    agents = sorted((models - set(predictors)) | (WITHOUT_WEIGHTS - {"guide", "carrier"}))
    return {"layouts": layout_names(), "agents": agents, "predictors": [*predictors, "random"]}


def _taken(file: StudyFile, served: Sequence[StudyFile]) -> Iterator[Problem]:
    if any(one.study.name == file.study.name for one in served):
        reason = f"{file.study.name!r} is the name of a study that this server serves from a file"
        yield Problem(("name",), reason, "Choose another name.")


def _foreign(file: StudyFile, served: Sequence[StudyFile]) -> Iterator[Problem]:
    """Refuse models that are files, Python classes or addresses: loading them runs or reads what they name, which only
    people with access to the server may decide, not accounts of the dashboard."""
    known = {without_variant(model) for one in served for _, _, model in models_named(one.study)}
    reported = set()
    for place, _, model in models_named(file.study):
        base = without_variant(model)
        if (is_foreign(base) or "/" in base) and base not in known and base not in reported:
            reported.add(base)
            reason = f"{base!r} is a file, a Python class or an address"
            remedy = "Name a bundled agent here, or one that a study file of this server names."
            yield Problem(place, reason, remedy)
