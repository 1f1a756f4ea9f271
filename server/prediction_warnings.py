"""Warnings about settings of a study that are probably unintended: predictions without relation to the partner."""

import json
from collections.abc import Iterator
from itertools import product
from typing import Any, Final

from models.agents.blackbox import is_foreign
from models.agents.model_paths import without_variant
from overcooked.layout import layout_names
from server.participation.episode_specs import predictor_of
from server.participation.training_commands import TrainingCommands, training_commands
from server.required_models import WITHOUT_WEIGHTS, RequiredModels, fingerprint, folder_of, required_models
from server.study.checks import Path, Problem, capitalised
from server.study.definition import PartnerSettings, Study
from server.study.loader import StudyFile

_RENAME: Final = "give this grid another name before you train for it: a bundled kitchen has this one."


def prediction_warnings(file: StudyFile) -> Iterator[Problem]:
    """Yield warnings about predictions that are shown and have no relation to the participants' partner. Loads no
    model."""
    study, required = file.study, required_models([file])
    yield from _untrained(study, required)
    if not shown_words(study):
        return
    yield from _practice_warnings(study)
    for index, agent in enumerate(study.agents):
        place: Path = ("agents", index, "predictor")
        if agent.predictor in WITHOUT_WEIGHTS and agent.predictor != agent.catalogue_name:
            yield _guessing(study, agent, place, required)
        names = {without_variant(predictor_of(study, agent, arm) or "") for arm in study.displays}
        for layout, name in product(study.layouts, sorted(names)) if not agent.human else ():
            base = required.paths.located(layout.name, name)
            config = folder_of(layout.name, base) / "config.json"
            if is_foreign(base) or base in WITHOUT_WEIGHTS or not config.is_file():
                continue
            watched = json.loads(config.read_text("utf-8")).get("agent_sha256")
            model = required.paths.located(layout.name, without_variant(agent.catalogue_name))
            played = _identity(layout.name, model, required)
            if watched and played and watched != played:
                reason = f"{name} was trained to predict another agent than {agent.name} on {layout.name}"
                yield Problem(place, reason, "Is that intended? Train one for this agent.", warning=True)


def _untrained(study: Study, required: RequiredModels) -> Iterator[Problem]:
    """Yield a warning about each kitchen drawn by hand in which no trained agent plays."""
    if any(agent.human or agent.catalogue_name not in WITHOUT_WEIGHTS for agent in study.agents):
        return
    for index, kitchen in enumerate(study.layouts):
        if kitchen.grid is not None:
            reason = f"only scripted agents play in {kitchen.name}, which was drawn by hand"
            grid = required.grid_of(kitchen.name)
            own = required.own.of_kitchen(kitchen.name, grid) if required.own is not None else {}
            trained = [name for name, one in own.items() if one.kind == "agent"]
            is_taken = commands_for(kitchen.name, required).is_taken
            words = capitalised(agent_words(kitchen.name, "", required))
            ready = f"Trained for it: {', '.join(trained)}." if trained else words
            where = "" if is_taken else " The kitchen's page in the dashboard has all commands."
            remedy = f"They can cook in every kitchen. {ready}{where}"
            yield Problem(("layouts", index, "name"), reason, remedy, warning=True)


def shown_words(study: Study) -> str:
    """Say which conditions show predictions of the partner; "" if none does."""
    of_partner = ("tom", "degraded", "misleading")
    shown = (arm for arm in study.displays if arm.predictor in of_partner and study.shows_predictions(arm))
    names = [f"`{arm.name}`" for arm in shown]
    if not names:
        return ""
    return f"condition {names[0]} shows" if len(names) == 1 else f"conditions {', '.join(names)} show"


def commands_for(layout: str, required: RequiredModels) -> TrainingCommands:
    """Return the commands that train for a kitchen."""
    return training_commands(layout, None if required.own is None else required.own.root, required.grids.get(layout))


def agent_words(layout: str, agent: str, required: RequiredModels) -> str:
    """Say how to train an agent for a layout."""
    commands = commands_for(layout, required)
    return _RENAME if commands.is_taken else f"train one: `{commands.agent(agent)}`{commands.note}."


def training_words(layout: str, agent: str, required: RequiredModels) -> str:
    """Say how to train a predictor of an agent on a layout."""
    commands = commands_for(layout, required)
    if commands.is_taken:
        return _RENAME
    where = "" if layout in layout_names() else " (before that, the partners on the kitchen's page in the dashboard)"
    return f"train one: `{commands.collect(agent)}`{where}, then `{commands.predictor(agent)}`."


def config_of(layout: str, model: str, required: RequiredModels) -> dict[str, Any]:
    """Return what a checkpoint says about itself; nothing for other models."""
    path = folder_of(layout, required.paths.located(layout, model)) / "config.json"
    found: dict[str, Any] = json.loads(path.read_text("utf-8")) if path.is_file() else {}
    return found


def is_for_grid(layout: str, model: str, required: RequiredModels) -> bool:
    """Return whether a model can be used in a layout's grid, as far as it says for which it was trained."""
    grid = required.grid_of(layout)
    return bool(config_of(layout, model, required).get("grid", grid) == grid)


def partner_at(study: Study, place: Path) -> PartnerSettings:
    """Return the agent whose setting has this place in the file."""
    if place[0] == "agents":
        return study.agents[int(place[1])]
    return study.waiting_room.agent if place[0] == "waiting_room" else study.tutorial.agent


def _guessing(study: Study, agent: PartnerSettings, place: Path, required: RequiredModels) -> Problem:
    """Return the warning about an agent whose predictor was not trained for it."""
    trained = f"{agent.model or agent.name}_predictor_{study.predictor.form}"
    lacking = [
        one.name
        for one in study.layouts
        if required.lacks(one.name, trained) is not None or not is_for_grid(one.name, trained, required)
    ]
    what = "guesses at random" if agent.predictor == "random" else f"knows the scripted {agent.predictor} only"
    kitchens = ", ".join(lacking or [one.name for one in study.layouts])
    reason = f"{shown_words(study)} predictions of {agent.name} in {kitchens}, and `{agent.predictor}` {what}"
    if lacking:
        remedy = training_words(lacking[0], agent.catalogue_name, required)
    else:
        remedy = f"leave `predictor` empty: {trained} is there."
    return Problem(place, reason, f"Is that intended? If not, {remedy}", warning=True)


def _practice_warnings(study: Study) -> Iterator[Problem]:
    """Yield a warning about a practice game that should teach intentions with an agent that has none: the guide only
    walks."""
    has_intentions = any(study.drawn(arm) in ("intention", "both") for arm in study.conditions)
    is_taught = "tutorial" in study.flow and "marks" in study.tutorial.lessons
    if has_intentions and is_taught and study.tutorial.agent.predictor == "guide":
        reason = "the practice shows no intention: the guide never uses a station"
        remedy = "Add `agent: {name: carrier, predictor: carrier}` to `tutorial`."
        place: Path = ("tutorial", "agent") if "agent" in study.tutorial.model_fields_set else ("tutorial",)
        yield Problem(place, reason, remedy, warning=True)


def _identity(layout: str, model: str, required: RequiredModels) -> str | None:
    """Return a predictor's identifier of the agent that it was trained for."""
    return None if model in WITHOUT_WEIGHTS else fingerprint(layout, model, required.paths.folders)
