"""Changes that the study builder offers where a kitchen has no trained models: scripted ones that play everywhere."""

from models.agents.blackbox import is_foreign
from server.prediction_warnings import is_for_grid, partner_at
from server.required_models import WEIGHTS, WITHOUT_WEIGHTS, RequiredModels
from server.study.checks import Path
from server.study.definition import PartnerSettings, Study
from server.study.quick_fixes import QuickFix, leave_in, leave_out, write

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
    """Offer to play in the kitchens without trained models only, and there scripted models in place of a missing one.
    None where the study needs a trained predictor, or where the place is not an agent of the rounds."""
    if place[0] not in ("agents", "waiting_room") or _needs_predictor(study):
        return None
    where, agent = place[:2], partner_at(study, place)
    new = [number for number, kitchen in enumerate(study.layouts) if not _has_trained(kitchen.name, required)]
    if len(new) < len(study.layouts):
        return _new_kitchens_only(study, agent, new, required)
    if place[-1] == "predictor":
        return write("Use random predictions", (*where, "predictor"), "random")
    if is_from_outside(agent):
        return None  # the path or the address is to be corrected
    chosen = _SCRIPTED.model_dump(exclude_unset=True)
    if place[0] == "waiting_room":
        return write(f"Let the {_SCRIPTED.name} stand in for a missing partner", where, chosen)
    if any(other.name == _SCRIPTED.name for other in study.agents if other is not agent):
        return leave_out(f"Leave {agent.name} out", where)
    return write(f"Use the {_SCRIPTED.name} with random predictions", where, chosen)


def _has_trained(kitchen: str, required: RequiredModels) -> bool:
    return any(trained_names(kitchen, required, predictors) for predictors in (False, True))


def _new_kitchens_only(
    study: Study, agent: PartnerSettings, new: list[int], required: RequiredModels
) -> QuickFix | None:
    """Offer to leave the template's kitchens out, if the agent is missing only in kitchens that are new."""
    names = [kitchen.name for kitchen in study.layouts]
    lacking = [number for number, name in enumerate(names) if required.lacks(name, agent.catalogue_name)]
    if not lacking or lacking != new:
        return None
    return leave_in(f"Play only in {' and '.join(names[number] for number in new)}", ("layouts",), new)


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
