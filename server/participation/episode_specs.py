"""Turn a step of a study into the episode that the live game plays. This is the only place that maps study settings to
game settings.
"""

from functools import cache
from typing import Literal

from overcooked.layout import Layout, load_layout, parse_layout
from overcooked.score import ProgressWeights
from server.play.episode_spec import EpisodeSpec, PauseLimits
from server.play.randomness import MISLEAD, uniform
from server.study.condition import Show
from server.study.definition import Condition, KitchenChoice, PartnerSettings, Study
from server.study.steps import StudyStep, episodes_of

_SHOWN: dict[str, Literal["nothing", "random", "predictor"]] = {
    "none": "nothing",
    "random": "random",
    "tom": "predictor",
    "degraded": "predictor",
    "misleading": "predictor",
}


def episode_spec(study: Study, step: StudyStep, condition: str, language: str, people: int = 1) -> EpisodeSpec:
    """Return the episode of a tutorial or episode step, for a participant in `condition` who reads `language`.
    `people`: how many play a round of two; a participant without a partner plays with the study's fallback agent.
    Episodes of all conditions differ only in what is shown: the predictor runs in each. Raises LayoutError or
    FileNotFoundError for an invalid layout (`kitchenmind study check` finds these first), KeyError for names that the
    study lacks."""
    arm = study.condition(condition).at(step.block)
    tutorial = step.kind == "tutorial"
    kitchen = study.tutorial.layout if tutorial else study.layout(step.layout)
    layout = layout_of(kitchen)
    agent = agent_of(study, step, people)
    other = None if agent.human else agent.catalogue_name
    seat = study.game.human_seat
    return EpisodeSpec(
        kind="tutorial" if tutorial else "episode",
        number=step.number,
        episodes=episodes_of(study),
        layout=layout.name,
        grid=layout.text,
        title=kitchen.title.of(language),
        agents=(None, other) if seat == 0 else (other, None),
        predictor=predictor_of(study, agent, arm),
        watched_seat=1 - seat,
        shown=_SHOWN[arm.predictor] if study.shows_predictions(arm) else "nothing",
        seed=step.seed,
        steps_shown=steps_shown_of(study, arm),
        confidence_opacity=opacity_of(study, arm),
        horizon=0 if tutorial else study.game.horizon,
        tick_ms=study.game.tick_ms,
        deadline_ms=study.game.deadline_ms,
        pause=PauseLimits(study.game.pause.each_s, study.game.pause.episode_s),
        progress=ProgressWeights(study.game.progress.onion_in_pot, study.game.progress.soup_on_dish),
        show=show_of(study, arm),
        view_radius=view_radius_of(study, arm),
        display=study.drawn(arm),
        misleading=not tutorial and is_misleading(arm, step),
        lessons=lessons(study, arm) if tutorial else (),
    )


def agent_of(study: Study, step: StudyStep, people: int = 1) -> PartnerSettings:
    """Return the partner in a tutorial or episode step; if a round of two is played by one, the study's fallback
    agent."""
    agent = study.tutorial.agent if step.kind == "tutorial" else study.agent(step.agent)
    return study.waiting_room.agent if agent.human and people == 1 else agent


def lessons(study: Study, condition: Condition) -> tuple[str, ...]:
    """Return the tutorial's lessons; marks are only taught to participants who will see some."""
    return tuple(key for key in study.tutorial.lessons if key != "marks" or study.shows_predictions(condition))


def show_of(study: Study, condition: Condition) -> Show:
    """Return when the marks of a condition are drawn; `always` also if it has none."""
    return (condition.show or study.predictor.show) if study.shows_predictions(condition) else "always"


def steps_shown_of(study: Study, condition: Condition) -> int:
    """Return how many predicted steps a condition draws."""
    return condition.steps_shown or study.predictor.steps_shown


def opacity_of(study: Study, condition: Condition) -> bool:
    """Return whether the marks of a condition fade with the predictor's confidence."""
    own = condition.confidence_opacity
    return study.predictor.confidence_opacity if own is None else own


def view_radius_of(study: Study, condition: Condition) -> int:
    """Return how many cells around their chef people in a condition see; 0: the whole kitchen."""
    own = condition.view_radius
    return (study.game.view_radius or 0) if own is None else own


def is_misleading(condition: Condition, step: StudyStep) -> bool:
    """Return whether the marks of a round mislead: from a certain round on, in a share of the rounds, drawn with the
    seed."""
    rounds = condition.misleading
    drawn = uniform(step.seed, 0, MISLEAD) < rounds.share
    return condition.predictor == "misleading" and step.number >= rounds.from_round and drawn


def layout_of(kitchen: KitchenChoice) -> Layout:
    """Return the layout of a study's kitchen, bundled or its own grid. Raises LayoutError, FileNotFoundError."""
    return _layout(kitchen.name, kitchen.grid)


def predictor_of(study: Study, agent: PartnerSettings, condition: Condition) -> str | None:
    """Return the name of the predictor that watches the agent; None for a person without a predictor. In a degraded
    condition it is the degraded one, except in the tutorial, where everybody learns to read the marks."""
    if agent.human and agent.predictor is None:
        return None
    name = agent.predictor or f"{agent.model or agent.name}_predictor_{condition.form or study.predictor.form}"
    if condition.accuracy is None or agent is study.tutorial.agent:
        return name
    return f"{name}@{100 * condition.accuracy:g}"


def models_of(study: Study) -> tuple[set[tuple[str, str]], set[tuple[str, str]]]:
    """Return all (layout, agent) and (layout, predictor) pairs that the study's games use."""
    games = [(kitchen.name, agent) for kitchen in study.layouts for agent in study.agents if "episodes" in study.flow]
    if "tutorial" in study.flow:
        games.append((study.tutorial.layout.name, study.tutorial.agent))
    if any(agent.human for _, agent in games):
        games += [(kitchen.name, study.waiting_room.agent) for kitchen in study.layouts]
    agents = {(layout, agent.catalogue_name) for layout, agent in games if not agent.human}
    asked = {(layout, predictor_of(study, agent, arm)) for layout, agent in games for arm in study.displays}
    return agents, {(layout, name) for layout, name in asked if name is not None}


@cache
def _layout(name: str, grid: str | None) -> Layout:
    return load_layout(name) if grid is None else parse_layout(grid, name)
