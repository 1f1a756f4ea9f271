"""Find the files of an ONNX model, and compute one hash of all of them.

A model may keep its weights in files next to it ("external data"). They are found by parsing the protobuf here, as
running a model does not need the `onnx` package.
"""

import hashlib
from collections.abc import Iterator
from pathlib import Path
from typing import Final

from models.protocols import BlackBoxError

# Where tensors can be: message -> {field number: message}, by onnx.proto.
_MESSAGES: Final[dict[str, dict[int, str]]] = {
    "model": {7: "graph", 25: "function"},
    "graph": {1: "node", 5: "tensor", 15: "sparse"},
    "function": {7: "node", 11: "attribute"},
    "node": {5: "attribute"},
    "attribute": {5: "tensor", 6: "graph", 10: "tensor", 11: "graph", 22: "sparse", 23: "sparse"},
    "sparse": {1: "tensor", 2: "tensor"},
    "tensor": {13: "entry"},
}
_DEEPEST: Final = 200
_VARINT, _FIXED_64, _BYTES, _FIXED_32 = 0, 1, 2, 5


def onnx_sha256(path: Path) -> str:
    """Return the SHA-256 that identifies a model: of its file, or of the list of files if its weights are next to it.

    Raises BlackBoxError for weights that are missing or outside the model's folder, OSError.
    """
    files = external_files(path)
    own = _digest(path)
    if not files:
        return own
    lines = [f"{own}  model", *(f"{_digest(path.parent / name)}  {name}" for name in files)]
    return hashlib.sha256("\n".join(lines).encode()).hexdigest()


def external_files(path: Path) -> list[str]:
    """Return the files with weights next to a model, sorted. Raises BlackBoxError as `onnx_sha256` does, OSError."""
    try:
        found = {location for location in _locations(memoryview(path.read_bytes()), "model", 0) if location}
    except (IndexError, ValueError) as error:
        raise BlackBoxError(f"{path} is not an ONNX model that can run here ({error}). Export it again.") from None
    for name in found:
        if Path(name).is_absolute() or ".." in Path(name).parts or "\\" in name:
            raise BlackBoxError(f"{path} keeps weights in {name!r}. They must be in the folder of the model.")
        if not (path.parent / name).is_file():
            raise BlackBoxError(f"{path} keeps weights in {name}, which is missing. Put the file next to the model.")
    return sorted(found)


def _locations(message: memoryview, kind: str, depth: int) -> Iterator[str]:
    """Yield the values of every external_data entry "location" below a message."""
    if depth > _DEEPEST:
        raise ValueError("nested too deep")
    for number, content in _fields(message):
        below = _MESSAGES[kind].get(number)
        if below == "entry":
            entry = {key: bytes(value).decode("utf-8") for key, value in _fields(content)}
            if entry.get(1) == "location":
                yield entry.get(2, "")
        elif below is not None:
            yield from _locations(content, below, depth + 1)


def _fields(message: memoryview) -> Iterator[tuple[int, memoryview]]:
    """Yield the fields of a protobuf message that hold bytes: number and content. Raises IndexError, ValueError."""
    at = 0
    while at < len(message):
        key, at = _varint(message, at)
        number, kind = key >> 3, key & 7
        if kind == _VARINT:
            _, at = _varint(message, at)
        elif kind in (_FIXED_64, _FIXED_32):
            at += 8 if kind == _FIXED_64 else 4
        elif kind == _BYTES:
            length, at = _varint(message, at)
            if length > len(message) - at:
                raise ValueError("cut off")
            yield number, message[at : at + length]
            at += length
        else:
            raise ValueError(f"wire type {kind}")


def _varint(message: memoryview, at: int) -> tuple[int, int]:
    value = shift = 0
    while True:
        byte = message[at]
        value |= (byte & 0x7F) << shift
        at, shift = at + 1, shift + 7
        if byte < 0x80:
            return value, at
        if shift > 63:
            raise ValueError("a number that is too long")


def _digest(path: Path) -> str:
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()
