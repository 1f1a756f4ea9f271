"""Pass text frames between a websocket's protocol and the game directly, without waking a task.

A timestep is one small frame to each browser, and a key is one small frame from it: through ASGI, waking the tasks
costs several times as much as the frames. The protocol puts a `DirectFrames` into the scope; whatever cannot be done
at once goes through ASGI, in the same order.
"""

from collections.abc import Callable, Mapping
from typing import Any, Final

EXTENSION: Final = "kitchenmind.direct_frames"  # in the extensions of an ASGI scope


def _never(_: object) -> bool:
    return False


class DirectFrames:
    """The two directions of one websocket; each call returns whether the frame was handled."""

    def __init__(self, write: Callable[[bytes], bool] = _never) -> None:
        """`write`: send a text frame unless the socket is closing or its buffer is full."""
        self.write = write
        self.take: Callable[[str], bool] = _never  # what the application does with an incoming text frame


def direct_frames(scope: Mapping[str, Any]) -> DirectFrames:
    """Return what the protocol offers; under another server, one that never does anything."""
    offered = (scope.get("extensions") or {}).get(EXTENSION)
    return offered if isinstance(offered, DirectFrames) else DirectFrames()
