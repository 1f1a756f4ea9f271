"""What a person's keys mean: which action they decide at the next tick. Knows neither clock nor socket."""

from dataclasses import dataclass

from overcooked.constants import INTERACT, STAY
from server.play.messages import Input


@dataclass(frozen=True)
class Press:
    """The Input that decided an action."""

    seq: int
    client_ms: float
    received: float  # when it arrived, in the time of whoever called `press`


class Keys:
    """One person's keys.

    A held move key moves one cell every tick; interact never repeats. A tap counts exactly once, however short. At most
    one tap to move and one to interact wait, the latest of each kind; they are done in the order pressed, one a tick.
    """

    def __init__(self) -> None:
        self.seq = -1  # of the newest Input taken into account
        self._held: int | None = None
        self._held_since: Press | None = None
        self._taps: dict[bool, tuple[int, Press]] = {}  # is it interact? -> (action, press); in the order pressed

    def press(self, keys: Input, received: float, taps_count: bool = True) -> bool:
        """Takes a message in. False: it is a repeat or older than one already seen, and nothing changed.

        `taps_count` False: the game stands still; a key that is held goes on counting, one just tapped does not.
        """
        if keys.seq <= self.seq:
            return False
        self.seq = keys.seq
        press = Press(keys.seq, keys.client_ms, received)
        if keys.held != self._held:
            self._held, self._held_since = keys.held, press
        if taps_count and keys.tap is not None and keys.tap != STAY:
            kind = keys.tap == INTERACT
            self._taps.pop(kind, None)
            self._taps[kind] = (keys.tap, press)
        return True

    def take(self) -> tuple[int, Press | None]:
        """The action of this tick and what decided it; None where no key did (the person waits)."""
        if self._taps:
            return self._taps.pop(next(iter(self._taps)))
        if self._held is not None:
            return self._held, self._held_since
        return STAY, None

    def clear(self) -> None:
        """Forgets every key, but not which messages were seen: after a pause nothing old comes back."""
        self._held = self._held_since = None
        self._taps.clear()

    def restart(self) -> None:
        """A new page counts its messages from the start."""
        self.clear()
        self.seq = -1
