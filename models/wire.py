"""What the server and a model worker say to each other: frames of a length and a msgpack body, arrays as raw bytes.
No torch, no pickle."""

import socket
import struct

import msgspec
from msgspec import Struct

LENGTH = struct.Struct(">I")

Name = tuple[str, str]  # layout, agent or predictor: what a worker is asked to load


class Load(Struct, tag=True, frozen=True):
    """Server to worker, once, first: what to load and warm."""

    agents: tuple[Name, ...]
    predictors: tuple[Name, ...]
    grids: dict[str, str] = {}  # layouts that are not shipped: name -> grid


class Loaded(Struct, tag=True, frozen=True):
    """Worker to server: everything answers. `memory`: how many states bring a game's predictor to where it would be."""

    memory: int


class Failed(Struct, tag=True, frozen=True):
    """Worker to server: a model does not load or does not fit; the worker ends."""

    reason: str


class Row(Struct, array_like=True, frozen=True):
    """One chef of one game. `fresh`: forget what is known about it, its states are a whole history."""

    key: str  # game and seat
    agent: str | None
    predictor: str | None
    states: int  # how many of the frame's states are its own, oldest first
    fresh: bool
    stuck: int
    uniform: float


class Ask(Struct, tag=True, frozen=True):
    """Server to worker: rows of one layout, and all their states one after the other."""

    id: int
    layout: str
    shape: tuple[int, int, int]  # width, height, planes
    rows: list[Row]
    observations: bytes  # int8 (states, width, height, planes)
    actions: bytes  # int8 (states, 2)


class Forget(Struct, tag=True, frozen=True):
    """Server to worker: these games are over."""

    keys: list[str]


class Fault(Struct, array_like=True, frozen=True):
    """A model that broke in one question."""

    model: str
    reason: str


class Answer(Struct, tag=True, frozen=True):
    """Worker to server: one value a row, in the order asked."""

    id: int
    model_ms: float
    acted: bytes  # int8 (rows,): the action, -1 where no agent answered
    laws: bytes  # float32 (rows, 6): the distribution the action was drawn from
    predicted: bytes  # int8 (rows,): 1 where a predictor answered
    predictions: bytes  # float32 (rows, STEPS, 6)
    faults: list[Fault]


_encoder = msgspec.msgpack.Encoder()
_from_server = msgspec.msgpack.Decoder(Load | Ask | Forget)
_from_worker = msgspec.msgpack.Decoder(Loaded | Failed | Answer)


def frame(message: Load | Ask | Forget | Loaded | Failed | Answer) -> bytes:
    """The bytes to send: length, body."""
    body = _encoder.encode(message)
    return LENGTH.pack(len(body)) + body


def from_server(body: bytes) -> Load | Ask | Forget:
    """What the server sent. Raises msgspec.DecodeError."""
    message: Load | Ask | Forget = _from_server.decode(body)
    return message


def from_worker(body: bytes) -> Loaded | Failed | Answer:
    """What a worker sent. Raises msgspec.DecodeError."""
    message: Loaded | Failed | Answer = _from_worker.decode(body)
    return message


def receive(connection: socket.socket) -> bytes | None:
    """The next frame's body, waiting for it; None when the other side is gone."""
    head = _receive_exactly(connection, LENGTH.size)
    return None if head is None else _receive_exactly(connection, LENGTH.unpack(head)[0])


def _receive_exactly(connection: socket.socket, size: int) -> bytes | None:
    chunks = bytearray()
    while len(chunks) < size:
        chunk = connection.recv(size - len(chunks))
        if not chunk:
            return None
        chunks += chunk
    return bytes(chunks)
