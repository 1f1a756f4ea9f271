"""The questions to the models about a state, and the decisions from their answers."""

from collections.abc import Sequence

from msgspec import Struct

from models.protocols import ENDLESS, Decision, Intention, Question
from overcooked.constants import ACTIONS
from server.play.episode_spec import EpisodeSpec
from server.play.randomness import PARTNER, uniform
from server.play.simulation import Simulation


class Answers(Struct, frozen=True, gc=False):
    """The models' answers about one state."""

    next_actions: tuple[int | None, int | None]  # by seat; None: a human's seat, or no answer in time
    prediction: tuple[tuple[float, ...], ...]  # (steps, 6); empty: no predictor, or no answer in time
    late: bool  # an agent did not answer in time: it will wait
    intentions: tuple[Intention, ...] = ()  # the likeliest first; empty: none, or no answer in time


def questions(episode: str, spec: EpisodeSpec, simulation: Simulation) -> list[Question]:
    """Return one question for each chef whom an agent plays or a predictor watches."""
    asked = []
    for seat, agent, predictor in spec.asked_models:
        asked.append(
            Question(
                game=episode,
                layout=spec.layout,
                seat=seat,
                timestep=simulation.timestep,
                agent=agent,
                predictor=predictor,
                uniform=uniform(spec.seed, simulation.timestep, PARTNER + seat),
                stuck=simulation.stuck[seat],
                history=simulation.history(seat),
                left=simulation.horizon - simulation.timestep if simulation.horizon else ENDLESS,
            )
        )
    return asked


def answers(asked: Sequence[Question], decisions: Sequence[Decision | None]) -> Answers:
    """Put the decisions on the questions of one state together; an invalid action counts as no answer."""
    next_actions: list[int | None] = [None, None]
    prediction: tuple[tuple[float, ...], ...] = ()
    intentions: tuple[Intention, ...] = ()
    late = False
    for question, decision in zip(asked, decisions, strict=True):
        if decision is None or not 0 <= decision.action < ACTIONS:
            late = late or question.agent is not None
            continue
        if question.agent is not None:
            next_actions[question.seat] = decision.action
        if question.predictor is not None:
            prediction, intentions = decision.prediction, decision.intentions
    return Answers((next_actions[0], next_actions[1]), prediction, late, intentions)
