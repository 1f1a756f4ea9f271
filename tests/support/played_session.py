"""A session without clock or socket, played timestep by timestep."""

from datetime import UTC, datetime

from server.play.episode_spec import EpisodeSpec
from server.play.messages import Input
from server.play.recorder import TickRecord
from server.play.session import Session
from tests.support.live_fakes import RuleModels, make_spec, new_record

AT = datetime(2026, 1, 1, tzinfo=UTC)
MODELS = RuleModels()


def start(spec: EpisodeSpec | None = None, now: float = 100.0) -> tuple[Session, TickRecord]:
    """A session whose start state is stored and whose clock runs from `now`."""
    session = Session(new_record(spec or make_spec()), now)
    assert session.release(0, now)
    session.count_down(now, now)
    record = session.finish_tick([MODELS.decide(question) for question in session.begin_start()], 1.0)
    session.stored = True
    return session, record


def tick(session: Session, now: float | None = None, models_ms: float = 1.0) -> TickRecord:
    questions = session.begin_tick(session.next_deadline if now is None else now)
    is_late = models_ms > session.spec.deadline_ms
    record = session.finish_tick([None if is_late else MODELS.decide(question) for question in questions], models_ms)
    session.stored = True
    return record


def press(session: Session, seq: int, held: int | None, tap: int | None, now: float | None = None) -> None:
    session.key(0, Input(seq, held, tap, float(seq)), session.next_deadline - 0.1 if now is None else now)
