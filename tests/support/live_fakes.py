"""Stand-ins for what is around the live game: a recorder in memory, models that answer by rule, a quiet connection."""

import asyncio
from collections.abc import Sequence
from dataclasses import replace

from models.inference.runner import ModelStatistics
from models.protocols import STEPS, Decision, Intention, Question
from overcooked.constants import ACTIONS, EAST, INTERACT, NORTH, SOUTH, STAY, WEST
from overcooked.interactions import InteractionKind
from overcooked.layout import load_layout
from server.play.episode_spec import EpisodeSpec
from server.play.messages import Outgoing
from server.play.recorder import EpisodeRecord, EpisodeResult, InputRecord, PauseRecord, RecorderDown, TickRecord

# In the coordination ring: an onion from the left crate, then a dish.
INTENTIONS = (
    Intention(InteractionKind.TAKE_ONION, 0, 3, 4, 0.5),
    Intention(InteractionKind.TAKE_DISH, 0, 2, 3, 0.25),
)


def make_spec(**changes: object) -> EpisodeSpec:
    """A human in seat 0, an agent in seat 1, a predictor that watches the agent."""
    layout = load_layout("coordination_ring")
    spec = EpisodeSpec(
        kind="episode",
        number=1,
        episodes=2,
        layout=layout.name,
        grid=layout.text,
        title="Coordination Ring",
        agents=(None, "sp"),
        predictor="sp_predictor_window",
        watched_seat=1,
        shown="predictor",
        seed=12345,
        horizon=40,
    )
    return replace(spec, **changes)  # type: ignore[arg-type]


def new_record(spec: EpisodeSpec, episode: str = "e1") -> EpisodeRecord:
    return EpisodeRecord(episode, ("p1", None), spec, (), None, "new", 0.0)


class MemoryRecorder:
    """A recorder as durable as this process. `down` refuses every commit."""

    def __init__(self) -> None:
        self.ticks_of: dict[str, dict[int, TickRecord]] = {}
        self.pauses: dict[object, PauseRecord] = {}
        self.inputs_of: dict[str, list[InputRecord]] = {}  # that came without a tick, pause or end
        self.results: dict[str, EpisodeResult] = {}
        self.down = False
        self.commits = 0

    async def ticks(self, records: Sequence[TickRecord]) -> None:
        self._check()
        self.commits += 1
        for record in records:
            stored = self.ticks_of.setdefault(record.episode, {})
            assert stored.get(record.timestep, record) == record, "two ticks in one place"
            assert record.timestep == len(stored) or record.timestep in stored, "a hole in the ticks"
            stored[record.timestep] = record

    async def pause(self, record: PauseRecord) -> None:
        self._check()
        self.pauses[record.episode, record.started_at] = record

    async def inputs(self, episode: str, records: Sequence[InputRecord]) -> None:
        self._check()
        self.inputs_of.setdefault(episode, []).extend(records)

    async def end(self, result: EpisodeResult) -> None:
        self._check()
        self.results.setdefault(result.episode, result)

    def _check(self) -> None:
        if self.down:
            raise RecorderDown("switched off")

    def load(self, spec: EpisodeSpec, episode: str = "e1") -> EpisodeRecord:
        """What a restarted server would find."""
        stored = [self.ticks_of.get(episode, {})[n] for n in sorted(self.ticks_of.get(episode, {}))]
        if not stored:
            return new_record(spec, episode)
        actions = tuple(tick.actions for tick in stored[1:] if tick.actions is not None)
        last = stored[-1]
        return EpisodeRecord(
            episode, ("p1", None), spec, actions, last.state_hash, "running", 0.0, last.next_actions, last.displayed,
            asked=last.asked, displayed_intention=last.displayed_intention,
        )  # fmt: skip


class RuleModels:
    """An agent that walks by the number it was given, and a predictor that is fairly sure of going east.

    `hang_s` makes it slow, `slow` one agent slower than any deadline, `broken` makes it raise, `silent` makes it answer
    nothing."""

    ready = True

    def __init__(self) -> None:
        self.hang_s = 0.0
        self.slow = ""
        self.broken = self.silent = False
        self.asked: list[Question] = []
        self.batches: list[int] = []
        self.forgotten: list[str] = []

    def statistics(self) -> ModelStatistics:
        return ModelStatistics(0, 0, {}, (0.0, 0.0, 0.0))

    async def ask(self, questions: Sequence[Question], deadline_ms: float) -> list[Decision | None]:
        self.asked.extend(questions)
        self.batches.append(len(questions))
        if self.broken:
            raise RuntimeError("broken on purpose")
        deadline_s, slow = deadline_ms / 1000, [question.agent == self.slow for question in questions]
        if waited_s := deadline_s if any(slow) else min(self.hang_s, deadline_s):
            await asyncio.sleep(waited_s)
        is_late = self.silent or self.hang_s > deadline_s
        return [None if is_late or slow[k] else self.decide(question) for k, question in enumerate(questions)]

    def decide(self, question: Question) -> Decision:
        action = (NORTH, SOUTH, EAST, WEST, STAY, INTERACT)[int(question.uniform * ACTIONS)]
        step = tuple(0.75 if action == EAST else 0.05 for action in range(ACTIONS))
        prediction, intentions = ((step,) * STEPS, INTENTIONS) if question.predictor else ((), ())
        return Decision(action, (1 / ACTIONS,) * ACTIONS, prediction, intentions)

    def forget(self, game: str) -> None:
        self.forgotten.append(game)


class QuietConnection:
    """Keeps what it was sent."""

    def __init__(self, tab: str = "tab-0001") -> None:
        self.tab = tab
        self.is_new_page = True
        self.next_url = "/s/test/now"
        self.sent: list[Outgoing] = []
        self.closed: int | None = None

    def send(self, message: Outgoing) -> None:
        if self.closed is None:
            self.sent.append(message)

    def close(self, code: int, reason: str) -> None:
        if self.closed is None:
            self.closed = code

    def of(self, kind: type) -> list[Outgoing]:
        return [message for message in self.sent if isinstance(message, kind)]
