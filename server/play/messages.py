"""Every message between browser and server, typed, by direction. JSON text frames; `type` distinguishes them.

docs/reference/protocol.md describes when each is sent, and a test compares. Unknown types, unknown fields and wrong
types are refused with `Refused` (the game continues); a frame over MAX_FRAME_BYTES closes the socket with 1009.
"""

from typing import Annotated, Literal

import msgspec
from msgspec import Meta, Struct

PROTOCOL = 1
MAX_FRAME_BYTES = 1024
MAX_READ_BYTES = 4 * MAX_FRAME_BYTES  # longer frames are never read: the websocket library closes the socket

Count = Annotated[int, Meta(ge=0)]
Seconds = Annotated[float, Meta(ge=0)]
Seq = Annotated[int, Meta(ge=0, lt=2**53)]
Milliseconds = Annotated[float, Meta(ge=0, le=1e15)]
Move = Annotated[int, Meta(ge=0, le=3)]
Tap = Literal[0, 1, 2, 3, 5]  # there is no key for staying
Action = Annotated[int, Meta(ge=0, le=5)]
ShownAction = Annotated[int, Meta(ge=0, le=6)]  # 6: nothing is drawn
ShownKind = Annotated[int, Meta(ge=0, le=8)]  # 0-7: an InteractionKind; 8: nothing is drawn
CellOrNone = Annotated[int, Meta(ge=-1)]
Opacity = Annotated[int, Meta(ge=0, le=100)]
Seat = Annotated[int, Meta(ge=0, le=1)]
SeatOrViewer = Annotated[int, Meta(ge=-1, le=1)]
Facing = Annotated[int, Meta(ge=0, le=3)]
Item = Annotated[int, Meta(ge=0, le=3)]
Onions = Annotated[int, Meta(ge=1, le=3)]
Cooking = Annotated[int, Meta(ge=-1, le=20)]  # -1: not cooking, 20: ready
PauseReason = Literal["hidden", "blur", "lost", "other_tab", "partner", "database", "researcher", "server"]
EndReason = Literal["horizon", "lessons", "away", "researcher", "withdrawn", "error"]
RefusalCode = Literal["bad_message", "hello_first", "not_now", "protocol", "no_game", "database", "broken"]


class FromBrowser(Struct, tag_field="type", tag=str.lower, forbid_unknown_fields=True, frozen=True):
    """Base of what a browser may send."""


class Hello(FromBrowser, frozen=True):
    """First message on a socket. `tab` is drawn once per tab: a participant's newest tab plays, others get
    `superseded`."""

    protocol: int
    tab: Annotated[str, Meta(min_length=8, max_length=64, pattern=r"\A[A-Za-z0-9_-]+\Z")]
    last_timestep: Annotated[int, Meta(ge=-1, le=100_000)] = -1


class Ready(FromBrowser, frozen=True):
    """The participant pressed start (or came back): the countdown may begin."""


class Input(FromBrowser, frozen=True):
    """The keys as they are now, sent on every change. `held`: the move key held down (repeated every timestep until the
    next Input), None if none. `tap`: an action just pressed, to be done once. `client_ms`: performance.now(). `marks`:
    whether the key that asks for the marks is down; None: nothing about it, it stays as it was."""

    seq: Seq
    held: Move | None
    tap: Tap | None
    client_ms: Milliseconds
    marks: bool | None = None


class Away(FromBrowser, frozen=True):
    """The page was hidden or lost the focus: pause."""

    reason: Literal["hidden", "blur"]


class Pong(FromBrowser, frozen=True):
    """Answer to Ping: the server measures the round trip."""

    id: Seq


class ClientError(FromBrowser, frozen=True, tag="trouble"):
    """An error on the participant's browser console, for the researcher's problem list."""

    text: Annotated[str, Meta(max_length=500)]


Incoming = Hello | Ready | Input | Away | Pong | ClientError


class ToBrowser(Struct, tag_field="type", tag=str.lower, frozen=True, omit_defaults=False, gc=False):
    """Base of what the server sends."""


class KitchenState(Struct, frozen=True, gc=False):
    """One state to draw. Cells are [column, row] from the top left."""

    t: Count
    players: tuple[tuple[Count, Count, Facing, Item], ...]  # x, y, facing, held
    counters: tuple[tuple[Count, Count, Item], ...]  # x, y, item
    pots: tuple[tuple[Count, Count, Onions, Cooking], ...]  # those that are not empty: x, y, onions, cooking time
    score: int
    soups: Count


class Welcome(ToBrowser, frozen=True):
    """Answer to Hello: all that is needed to draw, whether the episode is new or continues."""

    protocol: int
    episode: str
    kind: Literal["tutorial", "episode", "watch"]
    number: Count  # 1-based, among episodes of the plan; 0 for the tutorial
    episodes: Count
    layout: str
    title: str
    grid: tuple[str, ...]
    seat: SeatOrViewer  # the participant's chef; the other is the partner
    watched_seat: Seat  # whose next steps are drawn
    horizon: Count
    tick_ms: Annotated[int, Meta(ge=1)]
    steps: Count  # how many predicted steps a frame carries
    shows_predictions: bool
    state: KitchenState
    resumed: bool
    endless: bool = False  # no time limit (tutorial)
    partner: Literal["agent", "human"] = "agent"
    show: Literal["always", "on_key", "toggle"] = "always"  # when the marks are drawn: see Input.marks
    view_radius: Count = 0  # how many cells around their chef the participant sees; 0: the whole kitchen
    partner_seen: bool = True  # as in Tick
    unknown: tuple[tuple[Count, Count], ...] = ()  # as in Tick
    asked: bool = True  # as in Tick
    display: Literal["actions", "intention", "both", "none"] = "actions"  # what of a prediction frames carry
    away_s: Seconds = 0.0  # how long an absence that begins now may last; 0: not said


class Countdown(ToBrowser, frozen=True):
    """The game starts or continues in `seconds`."""

    seconds: Seconds
    away_s: Seconds = 0.0  # as in Welcome


class Tick(ToBrowser, frozen=True):
    """One timestep has been played and stored. `prediction`: for each step [action 0-6, opacity in %], about the
    timesteps t, t+1, t+2 of `state`; all conditions carry the same bytes. `applied`: the seq of the newest Input that
    had arrived when the timestep was played (-1: none). With limited sight, `state` is what the participant knows:
    `partner_seen`: whether the partner is in view, `unknown` which counters and pots never were. `asked`: whether
    the participant asks for the marks on this state; always true where marks need no asking. It is how a page that
    connects again, or a second one, knows whether a toggle is on. `intention`: what the watched chef will do next at
    which station: [kind 0-8, x, y, opacity in %]; kinds: 0 none soon, 1 take an onion, 2 take a dish, 3 take a soup, 4
    fill a pot, 5 plate a soup, 6 serve, 7 put down, 8 nothing is drawn. `pad` has no meaning: it makes the frames of
    all conditions equally long."""

    state: KitchenState
    prediction: tuple[tuple[ShownAction, Opacity], ...]
    actions: tuple[Action, Action]  # what was done in the timestep before this state
    applied: Annotated[int, Meta(ge=-1)]
    late: bool  # the partner missed its deadline and waited
    partner_seen: bool = True
    unknown: tuple[tuple[Count, Count], ...] = ()
    asked: bool = True
    intention: tuple[ShownKind, CellOrNone, CellOrNone, Opacity] = (8, -1, -1, 95)
    pad: str = ""


class Paused(ToBrowser, frozen=True):
    """Nothing moves."""

    reason: PauseReason
    left_s: Seconds  # how long the pause may last; 0: no limit


class Waiting(ToBrowser, frozen=True):
    """The other person of a round of two is not there yet. Once they are, the socket closes with 4005."""

    left_s: Seconds  # how long at most


class Lesson(ToBrowser, frozen=True):
    """Tutorial: which step is being taught, by its key in the study's texts."""

    key: str
    index: Count
    steps: Count
    done: bool


class Ended(ToBrowser, frozen=True):
    """The episode is over and stored; continue at `next`."""

    score: int
    soups: Count
    progress: float
    passed: bool
    next: str
    reason: EndReason


class Ping(ToBrowser, frozen=True):
    """Asks for a Pong."""

    id: Count


class Notice(ToBrowser, frozen=True):
    """A message from the researcher."""

    text: str


class Refused(ToBrowser, frozen=True):
    """What was sent is not understood or not allowed now; nothing changed."""

    code: RefusalCode
    reason: str


class Superseded(ToBrowser, frozen=True):
    """Another tab or device has taken over; this socket closes with 4001."""


Outgoing = Welcome | Waiting | Countdown | Tick | Paused | Lesson | Ended | Ping | Notice | Refused | Superseded

_decoder = msgspec.json.Decoder(Incoming)
_encoder = msgspec.json.Encoder()


class BadMessage(ValueError):
    """The frame is not a message of this protocol; the text says why."""


def decode(frame: str | bytes) -> Incoming:
    """Return the message in a text frame. Raises BadMessage."""
    try:
        message: Incoming = _decoder.decode(frame)
    except (msgspec.DecodeError, UnicodeDecodeError, RecursionError) as error:  # the last: too deeply nested
        raise BadMessage(str(error)) from None
    return message


def encode(message: Outgoing) -> bytes:
    """Return the UTF-8 text frame of a message."""
    return _encoder.encode(message)
