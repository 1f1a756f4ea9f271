"""Why a game is paused, since when, and how long it may be. Times are seconds of the caller's clock."""

from collections.abc import Iterable
from dataclasses import dataclass, replace

from server.play.episode_spec import PauseLimits
from server.play.recorder import AWAY_REASONS

DATABASE = "database"
RESEARCHER = "researcher"  # a researcher paused this game
STUDY = "study"  # a researcher paused all games of the study
ENDING = "ending"  # a researcher ends this game as soon as its state is stored
SERVER = "server"  # it stops, or has not responded for a moment
NOT_STARTED = "not_started"  # the participant has not pressed start yet: no pause, no limit

MIN_ABSENCE_S = 0.5  # the least that an absence counts for, which limits the number of pauses of a game

Holder = int | str  # a person's seat, or one of the above
_OF_RESEARCHERS = (RESEARCHER, STUDY, ENDING)  # the participant is told the same of all
_OF_THE_SERVER = (DATABASE, *_OF_RESEARCHERS, SERVER)  # the first that holds is the reason to show
_STOP_ABSENCES = (DATABASE, *_OF_RESEARCHERS)  # while one of them holds, nobody could return: absences do not count


@dataclass(frozen=True)
class Hold:
    reason: str
    since: float


class PauseReasons:
    """All reasons to pause one game. It may continue when the last one is released."""

    def __init__(self, limits: PauseLimits, away_ms: float, more_time_s: float = 0.0) -> None:
        self._limits_of_study, self._more_time_s = limits, more_time_s
        self._held: dict[Holder, Hold] = {}
        self._away_s = away_ms / 1000  # of absences that are over
        self._away_since: float | None = None  # since when somebody is away; of two who are away at once, the first
        self._stopped_at: float | None = None  # since when absences do not count

    def __bool__(self) -> bool:
        return bool(self._held)

    def __contains__(self, holder: Holder) -> bool:
        return holder in self._held

    @property
    def of_researcher(self) -> bool:
        """Whether a researcher pauses the game, alone or with its study."""
        return any(holder in self._held for holder in _OF_RESEARCHERS)

    def is_away(self, holder: Holder) -> bool:
        """Return whether this holder's time counts as an absence."""
        return holder in self._held and self._held[holder].reason in AWAY_REASONS

    def away_reason(self, person: int) -> str | None:
        """Return the reason of this person's absence; None: the person is there."""
        return self._held[person].reason if self.is_away(person) else None

    def hold(self, holder: Holder, reason: str, now: float) -> None:
        """Add a reason to pause. A person who is already away stays away since the first moment; one whom the server
        kept waiting does not."""
        held = self._held.get(holder)
        if held is None or held.reason not in AWAY_REASONS:
            self._held[holder] = Hold(reason, now)
        if self._away_since is None and self.is_away(holder):
            self._away_since = now
        if holder in _STOP_ABSENCES and self._stopped_at is None:
            self._stopped_at = now

    def before_start(self, person: Holder, people: Iterable[int]) -> str:
        """Return the reason for one of the people who leaves before the start: an absence if another one is ready and
        waits for them."""
        is_awaited = any(other != person and other not in self._held for other in people)
        return "lost" if is_awaited else NOT_STARTED

    def release(self, holder: Holder, now: float) -> None:
        self._held.pop(holder, None)
        anybody = any(map(self.is_away, self._held))
        if self._away_since is not None and not anybody:
            self._away_s += self._counted_s(self._away_since, now)
            self._away_since = None
        if self._stopped_at is not None and not any(one in self._held for one in _STOP_ABSENCES):
            self._stopped_at = None
            self._held = {one: replace(hold, since=now) for one, hold in self._held.items()}  # restart their time
            self._away_since = now if anybody else None

    def _counted_s(self, since: float, now: float) -> float:
        """Return how much an absence that is over now counts for."""
        if self._stopped_at is None:
            return max(MIN_ABSENCE_S, now - since)
        return max(0.0, self._stopped_at - since)  # it does not let the game continue: no minimum is needed

    def away_ms(self, now: float) -> float:
        """Return how much of the time that all absences together may take is used up by now. The time in which two
        people are away at once counts once: they share the limit, and often the cause."""
        lasting = 0.0 if self._away_since is None else self._counted_s(self._away_since, now)
        return 1000 * (self._away_s + lasting)

    def next_absence_s(self, now: float) -> float:
        """Return how long an absence that begins now may last."""
        return max(0.0, min(self._limits.each_s, self._limits.episode_s - self.away_ms(now) / 1000))

    def extend(self, more_time_s: float) -> bool:
        """Allow absences in this game to last this much longer than the study says, each one and all together. Return
        False for a number that is known already, or smaller: it came late."""
        if more_time_s <= self._more_time_s:
            return False
        self._more_time_s = more_time_s
        return True

    @property
    def _limits(self) -> PauseLimits:
        limits = self._limits_of_study
        return PauseLimits(limits.each_s + self._more_time_s, limits.episode_s + self._more_time_s)

    def reason(self, person: int) -> str:
        """Return the reason to show to this person: their own first, then the server's, then the other person's."""
        own = self._held.get(person)
        if own is not None:
            return own.reason
        for holder in _OF_THE_SERVER:
            if holder in self._held:
                return self._held[holder].reason
        return "partner"

    def left_s(self, now: float) -> float | None:
        """Return how long the absence that ends first may last; None: nobody's absence counts now."""
        if self._stopped_at is not None:
            return None
        away = [now - held.since for held in self._held.values() if held.reason in AWAY_REASONS]
        if self._away_since is None or not away:
            return None
        left_of_all = self._limits.episode_s - self._away_s - (now - self._away_since)
        return min(self._limits.each_s - max(away), left_of_all)
