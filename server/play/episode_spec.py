"""The specification of one episode, fixed before it starts. server.participation makes it, server.store keeps it,
server.play plays it.
"""

from dataclasses import dataclass, field
from functools import cached_property
from typing import Literal

from overcooked.constants import HORIZON
from overcooked.score import DEFAULT_PROGRESS, ProgressWeights


@dataclass(frozen=True)
class PauseLimits:
    """How long a participant may be away: one pause, and all pauses of an episode together."""

    each_s: float = 30.0
    episode_s: float = 60.0


@dataclass(frozen=True)
class EpisodeSpec:
    """One episode of one participant (or of two, or of none)."""

    kind: Literal["tutorial", "episode", "watch"]
    number: int  # 1-based among the plan's episodes; 0 for the tutorial
    episodes: int  # how many the plan has
    layout: str  # name
    grid: str  # the layout's text: an episode is re-simulated from its own record alone
    title: str
    agents: tuple[str | None, str | None]  # per seat: a name of models.agents.catalogue, or None for a human
    predictor: str | None  # what is asked each tick, in every condition
    watched_seat: int
    shown: Literal["nothing", "predictor", "random"]  # what the condition lets the participant see
    seed: int  # 63 bits; all randomness of the episode
    steps_shown: int = 3
    confidence_opacity: bool = False
    horizon: int = HORIZON  # 0: endless (tutorial)
    tick_ms: int = 200
    deadline_ms: int = 120
    pause: PauseLimits = field(default_factory=PauseLimits)
    progress: ProgressWeights = DEFAULT_PROGRESS
    show: Literal["always", "on_key", "toggle"] = "always"  # when the marks are drawn: as the marks key says, or always
    view_radius: int = 0  # how many cells around their chef people see; 0: the whole kitchen
    misleading: bool = False  # the marks are the most plausible wrong future
    display: Literal["actions", "intention", "both", "none"] = "actions"  # what of a prediction is drawn, if anything
    lessons: tuple[str, ...] = ()  # tutorial: keys of what is taught, in order (server.play.tutorial.LESSONS)

    @cached_property
    def shows_actions(self) -> bool:
        return self.shown != "nothing" and self.display in ("actions", "both")

    @cached_property
    def shows_intention(self) -> bool:
        return self.shown != "nothing" and self.display in ("intention", "both")

    @cached_property
    def asked_models(self) -> tuple[tuple[int, str | None, str | None], ...]:
        """The seats whose chef an agent plays or a predictor watches, with both."""
        watching = [self.predictor if seat == self.watched_seat else None for seat in range(len(self.agents))]
        seats = [(seat, agent, watching[seat]) for seat, agent in enumerate(self.agents)]
        return tuple(one for one in seats if one[1:] != (None, None))

    @cached_property
    def human_seats(self) -> tuple[int, ...]:
        return tuple(seat for seat, agent in enumerate(self.agents) if agent is None)
