"""The messages between the server and a model worker: frames of a length and a msgpack body, arrays as raw bytes.
No torch, no pickle."""

import socket
import struct

import msgspec
from msgspec import Struct

from models.protocols import ENDLESS

LENGTH = struct.Struct(">I")
_AT_ONCE = 1 << 20  # bytes read at once

Name = tuple[str, str]  # layout, agent or predictor: what a worker is asked to load
APART = "#"  # `ring#1`: a layout called ring, whose models are kept apart from those of another one called ring


class Load(Struct, tag=True, frozen=True):
    """Server to worker, once, first: what to load and warm."""

    agents: tuple[Name, ...]
    predictors: tuple[Name, ...]
    grids: dict[str, str] = {}  # layouts that are not bundled: name -> grid
    files: dict[str, str] = {}  # "layout/model" -> the model's name with its absolute path, where it has one
    folders: tuple[str, ...] = ()  # where Python modules are looked for
    hashes: dict[str, str] = {}  # "layout/model" -> what its files must hash to, as an earlier worker loaded them


class Loaded(Struct, tag=True, frozen=True):
    """Worker to server: all models answer. `memory`: how many past states restore a game's predictor; `hashes`: of the
    files that were loaded."""

    memory: int
    hashes: dict[str, str] = {}


class Failed(Struct, tag=True, frozen=True):
    """Worker to server: a model does not load or does not fit; the worker ends."""

    reason: str


class Row(Struct, array_like=True, frozen=True, gc=False):
    """One chef of one game. `fresh`: forget what is known about it, its states are a whole history; otherwise they
    follow on those that were sent before."""

    key: str  # game and seat
    agent: str | None
    predictor: str | None
    timestep: int  # of its newest state
    states: int  # how many of the frame's states are its own, oldest first
    fresh: bool
    stuck: int
    uniform: float
    seat: int = 0
    left: int = ENDLESS  # timesteps until the episode is over


class ModelRequest(Struct, tag=True, frozen=True):
    """Server to worker: rows of one layout, and all their states one after the other."""

    id: int
    layout: str
    rows: list[Row]
    players: bytes  # int8 (states, 2, 4), as `Kitchens.players`
    contents: bytes  # int8 (states, width, height)
    actions: bytes  # int8 (states, 2), the row's own action first


class Forget(Struct, tag=True, frozen=True):
    """Server to worker: these games are over."""

    keys: list[str]


class ModelFault(Struct, array_like=True, frozen=True):
    """A model that broke in one question."""

    model: str
    reason: str


class Answer(Struct, tag=True, frozen=True):
    """Worker to server: one value a row, in the order asked."""

    id: int
    model_ms: float
    acted: bytes  # int8 (rows,): the action, -1 where no agent answered
    action_distributions: bytes  # float32 (rows, 6): the distribution the action was drawn from
    predicted: bytes  # int8 (rows,): 1 where a predictor answered
    predictions: bytes  # float32 (rows, STEPS, 6)
    intentions: bytes  # INTENTION (rows, INTENTIONS); probability 0 where nothing is said
    faults: list[ModelFault]


_encoder = msgspec.msgpack.Encoder()
_from_server = msgspec.msgpack.Decoder(Load | ModelRequest | Forget)
_from_worker = msgspec.msgpack.Decoder(Loaded | Failed | Answer)


def frame(message: Load | ModelRequest | Forget | Loaded | Failed | Answer) -> bytes:
    """Return the bytes to send: length, body."""
    body = _encoder.encode(message)
    return LENGTH.pack(len(body)) + body


def from_server(body: bytes) -> Load | ModelRequest | Forget:
    """Return what the server sent. Raises msgspec.DecodeError."""
    message: Load | ModelRequest | Forget = _from_server.decode(body)
    return message


def from_worker(body: bytes) -> Loaded | Failed | Answer:
    """Return what a worker sent. Raises msgspec.DecodeError."""
    message: Loaded | Failed | Answer = _from_worker.decode(body)
    return message


class Inbox:
    """Frames as they come in on a socket."""

    def __init__(self, connection: socket.socket) -> None:
        self._connection = connection
        self._rest = bytearray()

    def wait(self) -> list[bytes]:
        """Return the bodies of all frames that have arrived, at least one; empty when the other side is gone."""
        while True:
            bodies = self._whole()
            if bodies:
                return bodies
            chunk = self._connection.recv(_AT_ONCE)
            if not chunk:
                return []
            self._rest += chunk

    def _whole(self) -> list[bytes]:
        bodies, at = [], 0
        while len(self._rest) - at >= LENGTH.size:
            begin = at + LENGTH.size
            end = begin + LENGTH.unpack_from(self._rest, at)[0]
            if end > len(self._rest):
                break
            bodies.append(bytes(self._rest[begin:end]))
            at = end
        del self._rest[:at]
        return bodies
