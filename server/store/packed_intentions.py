"""Intentions as the table of ticks has them: a few bytes each."""

import struct
from collections.abc import Sequence
from typing import Final

from msgspec.structs import astuple

from server.play.intentions import Intention, ShownIntention

MOST: Final = 2  # the likeliest and the runner-up
_PREDICTED: Final = struct.Struct("<BbbBf")  # kind, x, y, steps, probability
_SHOWN: Final = struct.Struct("<BbbB")  # kind, x, y, opacity


def pack(intentions: Sequence[Intention]) -> bytes | None:
    """Return what is stored of the likeliest intentions; None where there are none."""
    return b"".join([_PREDICTED.pack(*astuple(one)) for one in intentions[:MOST]]) or None


def unpack(blob: bytes | None) -> tuple[Intention, ...]:
    """Return the inverse of `pack`. Probabilities come back as rounded to 32 bits."""
    return tuple(Intention(*values) for values in _PREDICTED.iter_unpack(blob or b""))


def pack_shown(shown: ShownIntention | None) -> bytes | None:
    return None if shown is None else _SHOWN.pack(*shown)


def unpack_shown(blob: bytes | None) -> ShownIntention | None:
    if blob is None:
        return None
    kind, x, y, opacity = _SHOWN.unpack(blob)
    return kind, x, y, opacity
