"""The interfaces of agents and predictors: two protocols and the values passed to and from them. No torch here."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, Final, Protocol, runtime_checkable

import numpy as np
from msgspec import Struct
from numpy.typing import NDArray

STEPS = 3  # l: how many of the agent's next actions are predicted
HISTORY = 10  # n: how many steps the paper's predictor looks at
INTENTION_HORIZON = 20  # timesteps: an interaction that is farther ahead counts as none

Observations = NDArray[np.int8]  # (games, width, height, 26): the lossless encoding as the agent sees it
Probabilities = NDArray[np.float32]  # (games, 6)
Predictions = NDArray[np.float32]  # (games, STEPS, 6)
ENDLESS: Final = 1 << 30  # timesteps that are left in an episode without a horizon
INTENTIONS: Final = 2  # how many a predictor gives: the most likely, then the second most likely
INTENTION: Final = np.dtype(
    [("kind", np.int8), ("x", np.int8), ("y", np.int8), ("steps", np.int8), ("probability", np.float32)]
)  # the fields of an `Intention`; probability 0: not said
Intentions = NDArray[np.void]  # (games, INTENTIONS) of INTENTION


class BlackBoxError(ValueError):
    """A model from outside that cannot be used; the message says why and what to do."""


class Policy(Protocol):
    """An agent: gives action probabilities for observations on one layout. Stateless; every row is a game."""

    def probabilities(self, observations: Observations) -> Probabilities: ...


class Predictor(Protocol):
    """A model that watches one agent and predicts its next STEPS actions; it keeps the state that it needs of each
    game.

    `begin(slots)` forgets the games in those slots. `predict` is called once a timestep for the games in `slots`, with
    the observation of the current state as the watched agent sees it and the joint action that led to it (the watched
    agent's own first; (-1, -1) at timestep 0). It never sees the action that the agent is about to take.
    """

    def begin(self, slots: NDArray[np.intp]) -> None: ...

    def predict(
        self, slots: NDArray[np.intp], observations: Observations, last_actions: NDArray[np.int8]
    ) -> Predictions: ...


@runtime_checkable
class IntentionPredictor(Predictor, Protocol):
    """A predictor that also predicts the watched agent's next interaction. `intentions` is called after `predict` and
    with the same arguments. An entry with probability 0 is empty.
    """

    def intentions(
        self, slots: NDArray[np.intp], observations: Observations, last_actions: NDArray[np.int8]
    ) -> Intentions: ...


@dataclass(frozen=True)
class Mode:
    """How an agent turns probabilities into an action in a study; written in its card.

    Probabilities are sharpened with `temperature` (0 = the most likely action). After `stuck_after` timesteps without a
    change of the agent's own cell, facing or hand, `stuck_mix` of the probability goes evenly to the four moves, so
    that two chefs never block each other for good.
    """

    temperature: float = 0.0
    stuck_after: int = 3
    stuck_mix: float = 0.5


class Intention(Struct, frozen=True, gc=False):
    """A prediction of the watched agent's next interaction: one of `possible_interactions(layout)`."""

    kind: int  # an `InteractionKind`; NONE: no interaction within INTENTION_HORIZON timesteps
    x: int  # the station's cell; -1 for NONE
    y: int
    steps: int  # in how many timesteps it is done, 1 being the coming one; 0 for NONE
    probability: float  # of this kind at this station


class Decision(Struct, frozen=True, gc=False):
    """The models' output for one game in one timestep."""

    action: int  # the agent's action, 0-5
    probabilities: tuple[float, ...]  # of the action as drawn (after `Mode`), 6 values
    prediction: tuple[tuple[float, ...], ...]  # STEPS x 6; empty where no predictor watches
    intentions: tuple[Intention, ...] = ()  # the likeliest, then the runner-up; empty where the predictor has none


Card = dict[str, Any]


class History(Struct, frozen=True, gc=False):
    """The last k timesteps of one game, oldest first, the current state last: int8 arrays as bytes, see `Kitchens`. A
    worker makes observations of them, for all games in one call."""

    players: bytes  # (k, 2, 4), as `Kitchens.players`
    contents: bytes  # (k, width, height)
    actions: bytes  # (k, 2): what led to each state, own action first; (-1, -1) at the start


class Question(Struct, frozen=True):
    """The live game's request for one chef in one state: the action (if an agent has the seat) and the next steps (if a
    predictor watches). `uniform` in [0, 1) draws the action, so a game can be replayed."""

    game: str
    layout: str
    seat: int
    timestep: int
    agent: str | None
    predictor: str | None
    uniform: float
    stuck: int  # timesteps since the chef's own cell, facing or hand last changed
    history: Callable[[int], History]  # history(k): at most the last k states
    left: int = ENDLESS  # timesteps until the episode is over


class Models(Protocol):
    """The models of a server, which answer the questions of many games at once, outside the event loop."""

    async def ask(self, questions: Sequence[Question], deadline_ms: float) -> list[Decision | None]:
        """Return a decision for each question. None: no answer by the deadline, or a failing model."""
        ...

    def forget(self, game: str) -> None:
        """Drop what is remembered about a game that is over."""
        ...
