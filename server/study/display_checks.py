"""Check that the display settings of a study's conditions fit together. Pure: yields problems."""

from collections.abc import Iterator

from server.study.checks import Path, Problem
from server.study.condition import Condition
from server.study.definition import Study
from server.study.steps import episodes_of


def display_problems(study: Study) -> Iterator[Problem]:
    """Yield everything wrong with the display of a study whose single values are valid."""
    for index, condition in enumerate(study.displays):
        yield from _without_effect(study, condition, ("conditions", index))
        if condition.predictor not in ("none", "tom") and not study.shows_predictions(condition):
            reason = f"`predictor: {condition.predictor}` is about what is drawn, and `display: none` draws nothing"
            yield Problem(("conditions", index, "predictor"), reason, *_remedy(study, condition))
    yield from _debriefing(study)


def _without_effect(study: Study, condition: Condition, place: Path) -> Iterator[Problem]:
    """Yield a condition's own settings that do not affect what it draws."""
    drawn = study.drawn(condition)
    unused: tuple[str, ...] = ("show", "steps_shown", "confidence_opacity") if drawn == "none" else ()
    if condition.predictor == "none":
        unused = ("display", *unused)
    if drawn == "intention":
        unused = ("steps_shown",)
    what = "without marks" if drawn == "none" else "that draws no steps"
    for key in unused:
        value = getattr(condition, key)
        if value in (None, "always", "none", False):
            continue
        reason = f"`{key}: {str(value).lower()}` in a condition {what} has no effect"
        yield Problem((*place, key), reason, *_remedy(study, condition))


def _remedy(study: Study, condition: Condition) -> tuple[str, bool]:
    """Return the remedy, and whether it is only a warning: a full factorial needs combinations without effect, because
    no interaction can be tested without them."""
    if study.factors:
        return f"Keep it for a full factorial, or leave it out: `cells: {{without: [{condition.name}]}}`.", True
    if condition.predictor == "none":
        return "Remove it, or choose another `predictor`.", False
    return "Remove it, or choose another `display`.", False


def _debriefing(study: Study) -> Iterator[Problem]:
    """Check that misled participants are told so after the rounds."""
    misleading = [index for index, condition in enumerate(study.displays) if condition.predictor == "misleading"]
    for index, condition in enumerate(study.displays):
        if index not in misleading and "misleading" in condition.model_fields_set:
            reason = "`misleading` has no effect with another predictor"
            yield Problem(("conditions", index, "misleading"), reason, "Set `predictor: misleading`, or remove it.")
        rounds = episodes_of(study)
        if index in misleading and condition.misleading.from_round > rounds:
            reason = f"there is no round {condition.misleading.from_round}: the study has {rounds}"
            yield Problem(("conditions", index, "misleading", "from_round"), reason, f"Use 1 to {rounds}.")
    if study.debriefing is None:
        if misleading:
            reason = "marks that mislead people need a debriefing that says so"
            remedy = "Add a page to `pages` and `flow`, after episodes, and name it: `debriefing: KEY`."
            yield Problem(("conditions", misleading[0], "predictor"), reason, remedy)
    elif study.debriefing not in study.pages:
        known = ", ".join(study.pages) or "none"
        yield Problem(("debriefing",), f"there is no page {study.debriefing!r}", f"Known pages: {known}.")
    elif study.debriefing not in study.flow[study.flow.index("episodes") + 1 :] if "episodes" in study.flow else True:
        reason = "the debriefing does not follow the rounds"
        yield Problem(("debriefing",), reason, f"Put {study.debriefing!r} after `episodes` in `flow`.")
