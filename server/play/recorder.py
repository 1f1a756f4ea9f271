"""The interface between the live game and the database. server.store.store_recorder implements it."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from datetime import datetime
from typing import Final, Literal, Protocol

from msgspec import Struct

from server.play.episode_spec import EpisodeSpec
from server.play.intentions import Intention, ShownIntention

AWAY_REASONS = frozenset({"hidden", "blur", "lost", "other_tab"})  # these count against the limits of `PauseLimits`
PAUSE_REASONS = AWAY_REASONS | {"database", "researcher", "server"}
InputOutcome = Literal[
    "applied", "released", "replaced", "forgotten", "stood_still", "unchanged", "repeated", "ended", "marks"
]
APPLIED: Final = "applied"
RELEASED: Final = "released"
REPLACED: Final = "replaced"
FORGOTTEN: Final = "forgotten"
STOOD_STILL: Final = "stood_still"
UNCHANGED: Final = "unchanged"
REPEATED: Final = "repeated"
ENDED: Final = "ended"
MARKS: Final = "marks"
INPUT_OUTCOMES: Final[Mapping[InputOutcome, str]] = {
    APPLIED: "it decided the action of `timestep`, the first such timestep if a key was held",
    RELEASED: "the keys were released: no key was held from `timestep` on",
    REPLACED: "a later input came before the next timestep",
    FORGOTTEN: "the game was paused, or another page took over, before the next timestep",
    STOOD_STILL: "a tap while the game was paused",
    UNCHANGED: "neither a tap nor a change of the held key",
    REPEATED: "its number was not greater than earlier ones",
    ENDED: "the episode ended before the next timestep",
    MARKS: "the marks key was pressed or released, which counted in `timestep` for the first time; no action",
}


# Structs, as a frozen dataclass of so many fields takes six times as long to make, and many are made in every timestep.
# `gc=False`: nothing in them can be part of a cycle, so the garbage collector need not look at them.


class KeyRecord(Struct, frozen=True, gc=False):
    """The Input that decided a human's action in one tick."""

    seat: int
    seq: int
    client_ms: float  # performance.now() of the browser at the key press
    received_ms: float  # server monotonic, milliseconds since state 0 was due, pauses and countdowns not counted


class InputRecord(Struct, frozen=True, gc=False):
    """One Input that arrived in an episode, stored once its outcome is known."""

    episode: str
    seat: int
    number: int  # 1, 2, ... in the order in which this person's inputs arrived in the episode
    tab: str  # the browser tab's random name
    seq: int
    held: int | None
    tap: int | None
    client_ms: float  # performance.now() of the browser at the key press
    received_unix_ms: float  # the server's wall clock, milliseconds since 1970 (UTC)
    received_ms: float | None  # as KeyRecord.received_ms; None: the game stood still
    timestep: int | None  # the first timestep n in which it counted: its action leads to state n; None: in none
    outcome: InputOutcome
    marks: bool | None = None  # whether the marks key was down; None: the message said nothing about it


class TickRecord(Struct, frozen=True, gc=False):
    """Tick n of an episode: what made state n, and what the models said about state n."""

    episode: str
    timestep: int  # n, 0..horizon; tick 0 is the start state
    actions: tuple[int, int] | None  # applied to state n-1; None at tick 0
    state_hash: str  # of state n
    rewards: tuple[int, int]  # sparse, by player
    shaped: tuple[int, int]
    events: tuple[int, int]  # bits, overcooked.constants.EVENT_NAMES
    next_actions: tuple[int | None, int | None]  # decided by agents on state n (None: human seat or no answer)
    prediction: tuple[tuple[float, ...], ...]  # (3, 6) probabilities for timesteps n, n+1, n+2; empty: none or late
    displayed: tuple[tuple[int, int], ...]  # what the frame carried: [action 0-6, opacity %] a step; 6 = nothing
    keys: tuple[KeyRecord, ...]
    scheduled_ms: float  # deadline of this tick, milliseconds since state 0 was due, pauses not counted
    late_ms: float  # how much later than its deadline the tick began
    models_ms: float  # time the models took
    late: bool  # the models missed the deadline: the agent waits at timestep n
    made_unix_ms: float | None = None  # wall clock when state n was made, milliseconds since 1970; None: not known
    inputs: tuple[InputRecord, ...] = ()  # whose outcome has become known since the tick before; a separate table
    asked: bool | None = None  # whether the participant asked for the marks on state n; None: they are always drawn
    misleading: bool | None = None  # whether the marks of state n are a wrong future; None: a truthful round
    in_sight: bool | None = None  # whether the watched chef was in their view in state n; None: they see everything
    intentions: tuple[Intention, ...] = ()  # of the watched chef in state n, the likeliest first; empty: none or late
    displayed_intention: ShownIntention | None = None  # what the frame carried; None: the condition shows none


@dataclass(frozen=True)
class PauseRecord:
    """One interruption of one game: recorded when it begins (`duration_ms` None) and again when it is over. The two
    have the same `episode` and `started_at`: the second replaces the first."""

    episode: str
    timestep: int
    reason: str  # one of PAUSE_REASONS
    started_at: datetime  # UTC
    duration_ms: float | None  # until all were ready again; the 3-2-1 that follows is not counted. None: still lasting
    inputs: tuple[InputRecord, ...] = ()  # that no tick has recorded
    seat: int | None = None  # of the person whose absence began it; None: nobody's, or of one who watches two agents
    away_ms: float | None = None  # how much of it counted as people's absence; None: still lasting, or not known


@dataclass(frozen=True)
class StoredInputs:
    """What the next input of a person follows on."""

    count: int  # how many are stored
    seqs: Mapping[str, int] = field(default_factory=dict)  # the newest `seq` of each tab


@dataclass(frozen=True)
class EpisodeRecord:
    """An episode as stored, ready to be continued: its spec and all committed ticks' joint actions."""

    episode: str
    participants: tuple[str | None, str | None]  # participant ids by seat
    spec: EpisodeSpec
    joint_actions: tuple[tuple[int, int], ...]
    last_hash: str | None
    status: Literal["new", "running", "done", "aborted"]
    paused_ms: float  # how much of the pauses so far counted as absence
    next_actions: tuple[int | None, int | None] | None = None  # of the last stored tick; None where no tick is stored
    displayed: tuple[tuple[int, int], ...] | None = None  # of the last stored tick: what its frame carried
    known_at: datetime | None = None  # the last moment that is stored of it: of a tick, or of the end of a pause
    inputs: Mapping[int, StoredInputs] = field(default_factory=dict)  # by seat; nothing for a seat without inputs
    asked: bool | None = None  # of the last stored tick
    displayed_intention: ShownIntention | None = None  # of the last stored tick
    is_paused: bool = False  # by a researcher
    more_time_s: float = 0.0  # how much longer than `spec.pause` people may be away: a researcher has allowed it


@dataclass(frozen=True)
class EpisodeResult:
    """How an episode ended."""

    episode: str
    status: Literal["done", "aborted"]
    reason: str
    score: int
    soups: int
    progress: float
    passed: bool
    final_hash: str
    inputs: tuple[InputRecord, ...] = ()  # that no tick has recorded


class Recorder(Protocol):
    """Durable when it returns. Raises RecorderDown when the database cannot commit: the game pauses and asks again;
    GamesLost where several processes serve and another took a game up.

    Each call may be repeated with equal values (after RecorderDown nobody knows whether the commit arrived): a tick, a
    pause or an end that is already stored is left as it is.
    """

    async def ticks(self, records: Sequence[TickRecord]) -> None: ...

    async def pause(self, record: PauseRecord) -> None: ...

    async def inputs(self, episode: str, records: Sequence[InputRecord]) -> None:
        """Store inputs that arrived while the game was paused, when no tick will record them soon."""
        ...

    async def end(self, result: EpisodeResult) -> None: ...


class RecorderDown(Exception):
    """The database did not commit. Nothing was acknowledged; the same call may be repeated later."""


class GamesLost(Exception):
    """Other processes have taken these episodes up: nothing of them was stored, and nothing more may be done here.

    Everything else in the call is stored.
    """

    def __init__(self, episodes: set[str]) -> None:
        super().__init__(f"taken up elsewhere: {', '.join(sorted(episodes))}")
        self.episodes = frozenset(episodes)
