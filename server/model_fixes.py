"""Changes that the study builder offers where a kitchen has no trained models: scripted ones that play everywhere."""

from models.agents.blackbox import is_foreign
from server.prediction_warnings import is_for_grid
from server.required_models import WEIGHTS, WITHOUT_WEIGHTS, RequiredModels
from server.study.checks import Path
from server.study.definition import PartnerSettings, Study
from server.study.quick_fixes import QuickFix, leave_out, write

_SCRIPTED = PartnerSettings(name="planner", predictor="random")


def trained_names(layout: str, required: RequiredModels, predictors: bool) -> list[str]:
    """Return the trained agents or predictors that can be named for a kitchen."""
    names = sorted(path.parent.name for path in (WEIGHTS / layout).glob("*/config.json"))
    kept = [name for name in names if ("_predictor_" in name) == predictors and is_for_grid(layout, name, required)]
    own = {} if required.own is None else required.own.of_kitchen(layout, required.grid_of(layout))
    return [
        *kept,
        *(name for name, one in own.items() if (one.kind == "predictor") == predictors and name not in names),
    ]


def model_fix(study: Study, place: Path, required: RequiredModels) -> QuickFix | None:
    """Offer scripted models in place of a missing one, if no kitchen of the study has trained ones. None where the
    study needs a trained predictor, or where the place is not an agent of the rounds."""
    kitchens = [kitchen.name for kitchen in study.layouts]
    has_trained = any(trained_names(name, required, predictors) for name in kitchens for predictors in (False, True))
    if place[0] != "agents" or has_trained or _needs_predictor(study):
        return None
    index = int(place[1])
    agent = study.agents[index]
    if place[-1] == "predictor":
        return write("Use random predictions", ("agents", index, "predictor"), "random")
    if is_from_outside(agent):
        return None  # the path or the address is to be corrected
    if any(other.name == _SCRIPTED.name for other in study.agents if other is not agent):
        return leave_out(f"Leave {agent.name} out", ("agents", index))
    chosen = _SCRIPTED.model_dump(exclude_unset=True)
    return write(f"Use the {_SCRIPTED.name} with random predictions", ("agents", index), chosen)


def comes_with_its_agent(agent: PartnerSettings) -> bool:
    """Return whether an agent's predictor is the one that is trained for it: it can only be missing or there with the
    agent."""
    return not agent.human and agent.predictor is None and agent.catalogue_name not in WITHOUT_WEIGHTS


def is_from_outside(agent: PartnerSettings) -> bool:
    """Return whether an agent is a path, a file, a class or an address, not a name among trained ones."""
    return "/" in agent.catalogue_name or is_foreign(agent.catalogue_name)


def _needs_predictor(study: Study) -> bool:
    """Return whether a condition shows what random predictions cannot give: errors on purpose, or an intention."""
    return any(
        arm.predictor in ("degraded", "misleading")
        or (arm.predictor == "tom" and study.drawn(arm) in ("intention", "both"))
        for arm in study.displays
    )
