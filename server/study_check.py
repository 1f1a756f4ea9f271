"""Check whether a study can be played on this machine: its kitchens, agents and predictors."""

import difflib
import json
from collections.abc import Iterator
from itertools import product
from pathlib import Path as FilePath

from models.agents.blackbox import is_foreign
from models.agents.model_paths import is_class, without_variant
from overcooked.layout import Layout, LayoutError, bundled_grid
from server.participation.episode_specs import layout_of, models_of, predictor_of
from server.prediction_warnings import (
    agent_words,
    commands_for,
    config_of,
    is_for_grid,
    partner_at,
    shown_words,
    training_words,
)
from server.required_models import WITHOUT_WEIGHTS, RequiredModels, folder_of, required_models
from server.scripted_fixes import comes_with_its_agent, is_from_outside, model_fix, trained_names
from server.study.checks import Path, Problem, capitalised
from server.study.definition import KitchenChoice, PartnerSettings, Study
from server.study.factor_checks import in_factors
from server.study.loader import StudyFile


def stage_problems(file: StudyFile, loads: bool = True) -> Iterator[Problem]:
    """Yield invalid kitchens, and agents and predictors that are missing, cannot be loaded or do not fit. `loads`
    False: do not load those that exist, which takes seconds."""
    study = file.study
    places: list[tuple[Path, KitchenChoice]] = [(("layouts", index), one) for index, one in enumerate(study.layouts)]
    places.append((("tutorial", "layout"), study.tutorial.layout))
    sound: dict[str, Layout] = {}
    for path, kitchen in places:
        try:
            sound[kitchen.name] = layout_of(kitchen)
        except LayoutError as error:
            place = ", ".join(f"{word} {at}" for word, at in (("row", error.row), ("column", error.column)) if at)
            yield Problem((*path, "grid"), f"{place + ': ' if place else ''}{error.reason}", error.remedy)
        except FileNotFoundError as error:
            remedy = "Correct the name, draw the rows under `grid: |`, or save this kitchen in the dashboard."
            yield Problem((*path, "name"), str(error).rstrip("."), remedy)
        else:
            if bundled_grid(kitchen.name) not in (None, sound[kitchen.name].text):
                reason = f"{kitchen.name!r} is a bundled kitchen with another grid"
                remedy = "Give this grid a name of its own: agents and predictors are found by the kitchen's name."
                yield Problem((*path, "name"), reason, remedy, warning=True)
    if len(sound) == len({kitchen.name for _, kitchen in places}):  # models need valid kitchens
        yield from _model_problems(file, sound, loads)


def _variant_problems(study: Study) -> Iterator[Problem]:
    """Yield predictors written with a variant: `sp_predictor_stream@60` would silently be degraded in conditions that
    show the predictor itself."""
    places: list[tuple[Path, PartnerSettings]] = [(("agents", index), one) for index, one in enumerate(study.agents)]
    places += [(("waiting_room", "agent"), study.waiting_room.agent), (("tutorial", "agent"), study.tutorial.agent)]
    for place, agent in places:
        name = agent.predictor or ""
        if name != without_variant(name):
            remedy = "Name the predictor alone. A condition with `predictor: degraded` and `accuracy` makes it worse."
            yield Problem((*place, "predictor"), f"{name!r} asks for a variant of a predictor", remedy)


def missing_problems(file: StudyFile, required: RequiredModels) -> Iterator[Problem]:
    """Yield agents and predictors that this machine does not have, or that a study may not name, each with its place in
    the file."""
    yield from _variant_problems(file.study)
    reported = set()
    without_agent: set[tuple[Path, str]] = set()
    for place, layout, model in models_named(file.study):
        reason = required.lacks(layout, model)
        if reason is None:
            continue
        agent, game = partner_at(file.study, place), (place[:-1], layout)
        if place[-1] != "predictor":
            without_agent.add(game)
        elif game in without_agent and _follows(agent, layout, model, required):
            continue  # the agent's problem says it: neither was trained
        if reason not in reported:
            reported.add(reason)
            fix = model_fix(file.study, place, required)
            yield Problem(place, reason, _full_remedy(file.study, place, (layout, model), required), fix=fix)


def _follows(agent: PartnerSettings, layout: str, model: str, required: RequiredModels) -> bool:
    """Return whether a predictor is missing only because its agent was never trained."""
    return comes_with_its_agent(agent) and (layout, without_variant(model)) not in required.pins


def _full_remedy(study: Study, place: Path, name: tuple[str, str], required: RequiredModels) -> str:
    """Return how to get a missing model, and what depends on it."""
    layout, model = name
    agent, shown = partner_at(study, place), shown_words(study)
    remedy = _remedy(place, layout, model, required, agent.catalogue_name)
    if place[-1] == "predictor":
        return f"{remedy} {capitalised(shown)} its predictions." if shown else remedy
    predictors = {predictor_of(study, agent, arm) for arm in study.displays}
    lacks_predictor = any(one is not None and required.lacks(layout, one) for one in predictors)
    if comes_with_its_agent(agent) and lacks_predictor and not is_from_outside(agent):
        why = f": {shown} its predictions" if shown else ""
        remedy += f" It has no predictor either{why}. A scripted agent needs `predictor: random`."
    return remedy


def models_named(study: Study) -> Iterator[tuple[Path, str, str]]:
    """Yield every model of the study's games: place in the file, layout, name; a name occurs as often as it is used."""
    asked = set().union(*models_of(study))
    places: list[tuple[Path, PartnerSettings]] = [(("agents", index), one) for index, one in enumerate(study.agents)]
    places += [(("waiting_room", "agent"), study.waiting_room.agent), (("tutorial", "agent"), study.tutorial.agent)]
    for place, agent in places:
        predictors = {predictor_of(study, agent, arm) for arm in study.displays} - {None}
        names = [("model" if agent.model else "name", agent.catalogue_name)] if not agent.human else []
        names += [("predictor", str(name)) for name in sorted(map(str, predictors))]
        for layout, model in sorted(asked):
            yield from (((*place, key), layout, model) for key, name in names if name == model)


def _remedy(place: Path, layout: str, model: str, required: RequiredModels, agent: str) -> str:
    base = without_variant(model)
    if is_class(base):
        return f"Correct the name. Modules are looked for in {', '.join(required.paths.folders)} and in PYTHONPATH."
    if required.paths.located(layout, base) != base or base.endswith(".onnx"):
        here = " (it is in the current folder)" if FilePath(base).exists() else ""
        return f"Correct the path: it starts from the folder of the study file{here}."
    if (layout, base) in required.pins:
        return "Put its folder there; or name another one, and open a new version of the study."
    known = _there(layout, required, predictors=place[-1] == "predictor")
    near = difflib.get_close_matches(base, known, n=1, cutoff=0.5)
    guess = f"Did you mean {near[0]!r}? " if near else ""
    if place[-1] == "predictor":
        ready = f"Write `predictor: NAME` for this agent; there are: {', '.join(known)}"
        return f"{guess}{ready}. Or {training_words(layout, agent, required)}"
    named = f"{guess}Name an agent that can play this kitchen ({', '.join(known)})"
    return f"{named}, or {agent_words(layout, base, required)}"


def _model_problems(file: StudyFile, layouts: dict[str, Layout], loads: bool) -> Iterator[Problem]:
    required = required_models([file])
    yield from missing_problems(file, required)
    yield from _degraded_problems(required)
    yield from in_factors(file.study, _intention_problems(file.study, layouts, required))
    reported: set[str] = set()
    missing = set(required.missing)
    for place, layout, model in models_named(file.study):
        if (layout, model) in missing or layout not in layouts:
            continue
        problem = _wrong_kind(place, layout, model, required)
        problem = problem or _grid_problem(file.study, layouts[layout], model, required)
        problem = problem or (_unfit(place, layouts[layout], model, required) if loads else None)
        if problem is not None and problem.reason not in reported:
            reported.add(problem.reason)
            yield problem


def _intention_problems(study: Study, layouts: dict[str, Layout], required: RequiredModels) -> Iterator[Problem]:
    """Yield conditions that draw the intention of a predictor without intentions. Random ones need no predictor."""
    from models.agents.predictors import has_intentions

    reported: set[tuple[str, str]] = set()
    for index, arm in enumerate(study.conditions):
        if study.drawn(arm) not in ("intention", "both") or arm.predictor == "random":
            continue
        place: Path = ("conditions", index, "display") if arm.display else ("predictor", "display")
        for kitchen, agent in product(study.layouts, study.agents):
            name = predictor_of(study, agent, arm)
            there = name is not None and kitchen.name in layouts and required.lacks(kitchen.name, name) is None
            if name is None or not there or (kitchen.name, name) in reported:
                continue
            if not has_intentions(required.paths.located(kitchen.name, name), layouts[kitchen.name]):
                reported.add((kitchen.name, name))
                reason = f"`display: {study.drawn(arm)}` needs a predictor with intentions; on {kitchen.name}, {name!r}"
                remedy = "Use `display: actions`, or train it: `kitchenmind train intentions --help`."
                yield Problem(place, f"{reason} has none", remedy)


def _grid_problem(study: Study, layout: Layout, model: str, required: RequiredModels) -> Problem | None:
    if is_for_grid(layout.name, model, required):
        return None
    names = [kitchen.name for kitchen in study.layouts]
    place: Path = ("layouts", names.index(layout.name)) if layout.name in names else ("tutorial", "layout")
    reason = f"{model!r} was trained on another grid named {layout.name}"
    commands = commands_for(layout.name, required)
    if commands.is_taken:
        return Problem(place, reason, "Give this grid a name of its own, or name a model of this kitchen.")
    train = f": `{commands.agent(without_variant(model))}`{commands.note}" if "/" not in model else ""
    remedy = "Give your grid a name of its own, name a model of this kitchen, or train one for this grid"
    return Problem(place, reason, f"{remedy}{train}.")


def _wrong_kind(place: Path, layout: str, model: str, required: RequiredModels) -> Problem | None:
    """Return the problem of an agent that is named as a predictor, or the other way round."""
    kind = str(config_of(layout, model, required).get("format", "")).removeprefix("kitchenmind ").partition(" ")[0]
    wanted = "predictor" if place[-1] == "predictor" else "agent"
    if kind in ("", wanted):
        return None
    names = ", ".join(_there(layout, required, predictors=wanted == "predictor"))
    words = "it is an agent, not a predictor" if kind == "agent" else "it is a predictor, not an agent"
    reason = f"{model!r} cannot be used on {layout} here: {words}"
    return Problem(place, reason, f"Name one of: {names}.")


def _unfit(place: Path, layout: Layout, model: str, required: RequiredModels) -> Problem | None:
    """Return why an existing model cannot be used. A Python class is not run here: the server tries it when it
    starts."""
    from models.agents.catalogue import load_agent
    from models.agents.predictors import load_predictor

    base = required.paths.located(layout.name, without_variant(model))
    if is_class(base):
        return None
    try:
        if place[-1] == "predictor":  # of a network, how much worse it can be made is reported by _degraded_problems
            load_predictor(model if base in WITHOUT_WEIGHTS else base, layout)
        else:
            load_agent(required.paths.located(layout.name, model), layout)
    except (ValueError, OSError) as error:
        return Problem(place, f"{model!r} cannot be used on {layout.name}: {error}".rstrip("."), "Name another.")
    return None


def _degraded_problems(required: RequiredModels) -> Iterator[Problem]:
    """Yield problems of degraded conditions: degrading a predictor to an accuracy needs its measured accuracy."""
    for layout, model in required.predictors:
        name, _, wanted = model.rpartition("@")
        if not wanted.replace(".", "").isdigit():
            continue
        place: Path = ("conditions",)
        config = folder_of(layout, required.paths.located(layout, model)) / "config.json"
        if is_foreign(name):
            reason = f"nobody knows how often {name!r} is right, so it cannot be made worse"
            yield Problem(place, reason, "Name a predictor of ours in the agent's `predictor`, or drop the condition.")
        elif config.is_file():
            reached = json.loads(config.read_text("utf-8")).get("accuracy", {}).get("mean", 1.0)
            if float(wanted) > 100 * reached:
                reason = f"{name} reaches {reached:.0%} on {layout}, so a degraded version cannot reach {wanted} %"
                yield Problem(place, reason, f"Write `accuracy: {int(100 * reached) / 100}` or less.")


def _there(layout: str, required: RequiredModels, predictors: bool) -> list[str]:
    """Return the agents or predictors that can be named for a kitchen."""
    return [
        *trained_names(layout, required, predictors),
        *(["random"] if predictors else ["planner", "random", "stay"]),
    ]
