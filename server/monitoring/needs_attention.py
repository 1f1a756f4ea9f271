"""Find the running games that need attention: disconnected, hidden, idle or slow participants."""

from dataclasses import dataclass

from server.play.game import Game

IDLE_S = 20.0
LAG_MS = 250.0
CALM, LOOK, ACT = 0, 1, 2
_AWAY = {"hidden": "Hidden tab", "blur": "Not in focus", "lost": "Disconnected", "other_tab": "Other tab"}
_STAY = 4


@dataclass(frozen=True)
class Flag:
    """How urgent it is, in a word; since when, in seconds of the games' clock (None: not applicable)."""

    level: int
    word: str
    since: float | None = None


@dataclass
class _Seen:
    """The person's last activity, as sampled."""

    seq: int
    since: float


class Attention:
    """Samples games, and keeps since when each participant has been idle."""

    def __init__(self) -> None:
        self._seen: dict[tuple[str, int], _Seen] = {}  # by episode and seat

    def flag(self, game: Game, seat: int, rtt_ms: float | None, now: float) -> Flag:
        """Return the flag of the person on this seat."""
        session = game.session
        idle_s = self._idle_s(game, seat, now)
        pause = session.pause_record
        if session.phase in ("paused", "waiting") and seat not in game.connections and (pause or session.resumed):
            return Flag(ACT, "Disconnected", session.paused_since)
        if session.phase == "paused" and pause is not None:
            away = session.pause_reasons.away_reason(seat)
            if away is not None:
                return Flag(ACT, _AWAY[away], session.paused_since)
            return Flag(LOOK, "Paused" if session.pause_reasons.of_researcher else "Waiting", session.paused_since)
        if session.phase == "waiting":
            return Flag(LOOK, "Paused") if session.pause_reasons.of_researcher else Flag(CALM, "Not started")
        if session.phase == "running" and idle_s >= IDLE_S:
            return Flag(LOOK, "Idle", now - idle_s)
        if rtt_ms is not None and rtt_ms > LAG_MS:
            return Flag(LOOK, f"Lag {rtt_ms:.0f} ms")
        return Flag(CALM, "Countdown" if session.phase == "countdown" else "Playing")

    def forget(self, kept: set[str]) -> None:
        """Forget all games but these."""
        self._seen = {key: seen for key, seen in self._seen.items() if key[0] in kept}

    def _idle_s(self, game: Game, seat: int, now: float) -> float:
        session = game.session
        keys = session.keys.get(seat)
        actions = session.simulation.last_actions
        seq = keys.seq if keys else 0
        seen = self._seen.get((session.episode, seat))
        moved = actions is not None and actions[seat] != _STAY
        if seen is None or seq != seen.seq or moved or session.phase != "running":
            self._seen[session.episode, seat] = _Seen(seq, now)
            return 0.0
        return now - seen.since
