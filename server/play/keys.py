"""Turn a person's keys into the action of the next tick."""

from operator import attrgetter
from typing import Final

from msgspec import Struct

from overcooked.constants import INTERACT, STAY
from server.play.marks_key import MarksKey
from server.play.messages import Input
from server.play.recorder import (
    APPLIED,
    FORGOTTEN,
    MARKS,
    RELEASED,
    REPEATED,
    REPLACED,
    STOOD_STILL,
    UNCHANGED,
    InputOutcome,
    InputRecord,
    StoredInputs,
)

_MAX_TABS: Final = 16  # of one person in one game whose last message is remembered
MAX_SETTLED: Final = 1000  # inputs of one person that wait to be stored; a paused game stores none


class InputArrival(Struct, frozen=True, gc=False):
    """The source and the browser's time of an Input; the caller of `press` gives the server's time."""

    tab: str = ""
    unix_ms: float = 0.0
    game_ms: float | None = None  # as KeyRecord.received_ms; None while the game stands still


class Press(Struct, eq=False, gc=False):
    """One Input and its outcome."""

    number: int  # 1, 2, ... in the order of arrival
    keys: Input
    received: float  # when it arrived, on the clock of the caller of `press`
    arrival: InputArrival
    outcome: InputOutcome | None = None  # None: not known yet
    timestep: int | None = None  # the first timestep in which it counted

    @property
    def seq(self) -> int:
        return self.keys.seq


_UNKNOWN = InputArrival()


class Keys:
    """One person's keys.

    A held move key moves one cell every tick; interact never repeats. A tap counts exactly once, however short. At most
    one tap to move and one to interact wait, the latest of each kind; they are done in the order pressed, one a tick.
    """

    def __init__(self, stored: StoredInputs | None = None, marks_key: MarksKey | None = None) -> None:
        """`stored`: what came before this server took the episode up. `marks_key`: where it has a meaning."""
        self.marks_key = marks_key
        self._marks: list[Press] = []  # presses and releases of the marks key since the last timestep
        self.seq = -1  # of the newest Input taken into account
        self._count = 0 if stored is None else stored.count
        self._seqs = {} if stored is None else dict(stored.seqs)  # by tab
        self._tab: str | None = None
        self._held: int | None = None
        self._held_by: Press | None = None  # the Input that changed what is held last, also to nothing
        self._taps: dict[bool, tuple[int, Press]] = {}  # is it interact? -> (action, press); in the order pressed
        self._settled: list[Press] = []

    def press(self, keys: Input, received: float, taps_count: bool = True, arrival: InputArrival = _UNKNOWN) -> bool:
        """Handle an Input. Returns False, and changes nothing, for a repeated or outdated one. `taps_count` False: the
        game is paused; a held key still counts, a tap does not.
        """
        self._count += 1
        press = Press(self._count, keys, received, arrival)
        if keys.seq <= self.seq:
            self._settle(press, REPEATED)
            return False
        self.seq = keys.seq
        changed = keys.held != self._held
        counts = taps_count and keys.tap is not None
        if changed:
            before, self._held, self._held_by = self._held_by, keys.held, press
            self._drop(before, REPLACED)
        if counts and keys.tap is not None:
            kind = keys.tap == INTERACT
            replaced = self._taps.pop(kind, None)
            self._taps[kind] = (keys.tap, press)
            self._drop(replaced[1] if replaced else None, REPLACED)
        asks = self.marks_key is not None and self.marks_key.put(keys.marks)
        if asks:
            self._marks.append(press)
            if len(self._marks) > MAX_SETTLED:  # while the game stands still, nothing else takes them away
                self._drop(self._marks.pop(0), REPLACED)
        if not (changed or counts or asks):
            self._settle(press, UNCHANGED if keys.tap is None else STOOD_STILL)
        return True

    def take(self, timestep: int = 0) -> tuple[int, Press | None]:
        """Return the action of this timestep and what decided it; None where no key did (the person waits)."""
        if self._marks:
            marks, self._marks = self._marks, []
            for press in marks:
                if press is not self._held_by and not self._waits(press):
                    self._settle(press, MARKS, timestep)
        if self._held is None and self._held_by is not None and not self._waits(self._held_by):
            self._settle(self._held_by, RELEASED, timestep)
        if self._taps:
            action, press = self._taps.pop(next(iter(self._taps)))
            self._settle(press, APPLIED, timestep)
            return action, press
        if self._held is not None and self._held_by is not None:
            self._settle(self._held_by, APPLIED, timestep)
            return self._held, self._held_by
        return STAY, None

    def clear(self, outcome: InputOutcome = FORGOTTEN) -> None:
        """Forget every key, but not which messages were seen, so that no old key acts after a pause."""
        waiting = [press for _, press in self._taps.values()]
        if self._held_by is not None:
            waiting.append(self._held_by)
        waiting += self._marks
        if self.marks_key is not None:
            self.marks_key.release()
        self._held = self._held_by = None
        self._taps.clear()
        self._marks.clear()
        for press in waiting:
            self._settle(press, outcome)

    def page(self, tab: str, is_new: bool) -> None:
        """Note that a page takes over. A new one counts its messages from the start; one that was here before keeps
        counting, so that a message repeated after a lost connection has no second effect."""
        self.clear()
        if self._tab is not None:
            self._seqs[self._tab] = self.seq
        self._tab = tab
        self.seq = -1 if is_new else self._seqs.get(tab, -1)
        while len(self._seqs) > _MAX_TABS:
            del self._seqs[next(iter(self._seqs))]

    def take_settled(self, episode: str, seat: int) -> list[InputRecord]:
        """Return the Inputs whose outcome has become known since the last call, in the order of arrival."""
        if not self._settled:
            return []
        settled, self._settled = self._settled, []
        if len(settled) > 1:
            settled.sort(key=attrgetter("number"))
        return [_record(episode, seat, press) for press in settled]

    def _waits(self, press: Press) -> bool:
        return any(press is waiting for _, waiting in self._taps.values())

    def _drop(self, press: Press | None, outcome: InputOutcome) -> None:
        """Remove an Input that no longer waits here; unless it still waits as the other of tap and held, its outcome is
        known."""
        if press is not None and press is not self._held_by and not self._waits(press):
            self._settle(press, outcome)

    def _settle(self, press: Press, outcome: InputOutcome, timestep: int | None = None) -> None:
        """Set the outcome, unless there is one: a held key decides many timesteps."""
        if press.outcome is None:
            press.outcome, press.timestep = outcome, timestep
            if len(self._settled) < MAX_SETTLED:
                self._settled.append(press)


def _record(episode: str, seat: int, press: Press) -> InputRecord:
    return InputRecord(
        episode=episode,
        seat=seat,
        number=press.number,
        tab=press.arrival.tab,
        seq=press.seq,
        held=press.keys.held,
        tap=press.keys.tap,
        client_ms=press.keys.client_ms,
        received_unix_ms=press.arrival.unix_ms,
        received_ms=press.arrival.game_ms,
        timestep=press.timestep,
        outcome=press.outcome or FORGOTTEN,
        marks=press.keys.marks,
    )
