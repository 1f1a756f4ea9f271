"""One episode as a pure state machine: keys and decisions in, states, records and messages out. `loop` drives it."""

from collections.abc import Sequence
from dataclasses import replace
from datetime import datetime
from functools import lru_cache
from typing import Final, Literal, cast

from models.protocols import Decision, Question
from overcooked.constants import STAY
from overcooked.layout import parse_layout
from overcooked.score import progress_credit
from server.play import messages, model_questions
from server.play.frames import Frames, marks_key
from server.play.keys import InputArrival, Keys
from server.play.pause_reasons import NOT_STARTED, Holder, PauseReasons
from server.play.recorder import ENDED, EpisodeRecord, EpisodeResult, InputRecord, KeyRecord, PauseRecord, TickRecord
from server.play.simulation import ReplayMismatch as ReplayMismatch
from server.play.simulation import SimulatedStep, Simulation
from server.play.tutorial import Tutor

Phase = Literal["waiting", "countdown", "running", "paused", "ended"]
VIEWER: Final = -1  # the "seat" of a participant who watches two agents
COUNTDOWN_S: Final = 3
_layout = lru_cache(maxsize=256)(parse_layout)  # one object for all games in a kitchen: they are stepped together
_STILL: Final = SimulatedStep((STAY, STAY), (0, 0), (0, 0), (0, 0))


class Session:
    """One episode from its record: new, or re-simulated to where it stood.

    A timestep: `begin_tick` (rules) -> questions to the models -> `finish_tick` (record) -> once stored `tick_message`.
    """

    def __init__(self, record: EpisodeRecord, now: float) -> None:
        """Replay the record's episode so far. Raises ReplayMismatch, LayoutError."""
        spec = record.spec
        self.episode, self.spec, self.tick_s = record.episode, spec, spec.tick_ms / 1000
        self.people: tuple[int, ...] = spec.human_seats or (VIEWER,)
        self.keys = {seat: Keys(record.inputs.get(seat), marks_key(record, seat)) for seat in spec.human_seats}
        self.simulation = Simulation(_layout(spec.grid, spec.layout), spec.horizon)
        lessons = tuple(key for key in spec.lessons if key != "marks" or spec.shown != "nothing")
        self.tutor = Tutor(lessons, self.people[0]) if lessons and spec.human_seats else None
        self.frames = Frames(record, self.simulation)
        self._replay(record)
        self.stored = record.last_hash is not None  # is the current state stored, with what was decided on it?
        self.next_actions = record.next_actions or (None, None)
        self.late = False
        self.resumed = self.stored  # also at the start state, which is stored when the first countdown begins
        self.phase: Phase = "paused" if self.resumed else "waiting"
        self.pause_reasons = PauseReasons(spec.pause, record.paused_ms, record.more_time_s)
        self.pause_record: PauseRecord | None = None  # of the pause that lasts
        self.paused_since = now
        self._away_told_ms = record.paused_ms  # how much of the absences the pauses so far account for
        for person in self.people:
            self.pause_reasons.hold(person, "server" if self.resumed else NOT_STARTED, now)
        self._zero = 0.0  # when timestep 0 would have been, had there been no pause
        self.next_deadline = 0.0  # when the next timestep is due; means something during countdown and running
        self._asked: list[Question] = []
        self._step = _STILL
        self._keys_used: tuple[KeyRecord, ...] = ()
        self._applied, self._late_ms = dict.fromkeys(self.people, -1), 0.0
        self.record: TickRecord | None = None  # of the current state, once it was made here

    def _replay(self, record: EpisodeRecord) -> None:
        for actions in record.joint_actions:
            step = self.simulation.step(actions)
            self.frames.watch()
            if self.tutor is not None:
                self.tutor.watch(self.simulation, step)
        if record.last_hash is not None and self.simulation.hash() != record.last_hash:
            place = f"episode {record.episode}, timestep {self.simulation.timestep}"
            raise ReplayMismatch(f"{place}: the stored actions do not lead to the stored state")

    # Time

    @property
    def heard_from_all(self) -> bool:
        """Whether every person has sent keys since the timestep before."""
        return all(keys.seq != self._applied[seat] for seat, keys in self.keys.items())

    @property
    def moving(self) -> bool:
        """Whether the clock of the game runs, or is about to."""
        return self.phase in ("countdown", "running")

    @property
    def over(self) -> bool:
        """Whether the episode is over; the result then waits to be stored."""
        if self.spec.horizon and self.simulation.timestep >= self.spec.horizon:
            return True
        return self.spec.kind == "tutorial" and self._learnt()

    # People

    def key(self, seat: int, keys: messages.Input, now: float, tab: str = "", unix_ms: float = 0.0) -> bool:
        """Return a person's keys. False: a message seen before, nothing changed. Until the game moves, taps do not
        count."""
        go = self._zero + self.simulation.timestep * self.tick_s
        game_ms = round((now - self._zero) * 1000, 3) if self.moving else None
        return self.keys[seat].press(keys, now, self.moving and now >= go, InputArrival(tab, unix_ms, game_ms))

    def settled_inputs(self) -> tuple[InputRecord, ...]:
        """Return the inputs whose outcome has become known since the last call, to be stored."""
        settled: list[InputRecord] = []
        for seat, keys in self.keys.items():
            settled += keys.take_settled(self.episode, seat)
        return tuple(settled)

    def pause(self, holder: Holder, reason: str, now: float, at: datetime) -> PauseRecord | None:
        """Stop the game at once; the PauseRecord to store if it was moving. Before the start nothing pauses."""
        for keys in self.keys.values():
            keys.clear()
        waits_already = self.phase == "waiting" and isinstance(holder, int) and holder in self.pause_reasons
        if self.phase == "ended" or waits_already:
            return None
        started = self.stored or self.simulation.timestep > 0
        counts = started or isinstance(holder, str)
        self.pause_reasons.hold(holder, reason if counts else self.pause_reasons.before_start(holder, self.people), now)
        if not self.moving:
            return None
        self.phase = "paused" if started else "waiting"
        if not started:
            return None
        self.paused_since = now
        seat = holder if isinstance(holder, int) and holder != VIEWER else None
        self.pause_record = PauseRecord(self.episode, self.simulation.timestep, reason, at, None, seat=seat)
        return replace(self.pause_record, inputs=self.settled_inputs())

    def release(self, holder: Holder, now: float) -> bool:
        """Release a person's pause. True: no reason to pause is left, `count_down` may be called."""
        self.pause_reasons.release(holder, now)
        return not self.pause_reasons and self.phase in ("waiting", "paused")

    def keeps_waiting(self, person: int) -> bool:
        """Return whether this person is ready, but somebody or something else keeps the game from starting."""
        return self.phase == "waiting" and bool(self.pause_reasons) and person not in self.pause_reasons

    def expect_others(self, person: int, now: float) -> None:
        """Note that somebody is ready: from now on the other people's time counts as an absence."""
        for other in self.people:
            if other != person and other in self.pause_reasons:
                self.pause_reasons.hold(other, "lost", now)

    def count_down(self, now: float, go: float) -> PauseRecord | None:
        """Let the game move at `go`; return the PauseRecord of the pause that is over, to be stored."""
        self.phase = "countdown"
        self.start_at(go)
        return self.end_pause(now)

    def end_pause(self, now: float) -> PauseRecord | None:
        """Return the current pause, as over now, to be stored: the game moves again, or this server stops playing
        it."""
        record, self.pause_record = self.pause_record, None
        away_ms, self._away_told_ms = self._away_told_ms, self.pause_reasons.away_ms(now)
        if record is None:
            return None
        return replace(
            record,
            duration_ms=round((now - self.paused_since) * 1000, 3),
            away_ms=round(self._away_told_ms - away_ms, 3),
            inputs=self.settled_inputs(),
        )

    def start_at(self, go: float) -> None:
        """Move the deadlines: the current state stands until `go`, the next one comes a tick later."""
        self._zero = go - self.simulation.timestep * self.tick_s
        self.next_deadline = go + self.tick_s

    # Ticks

    def begin_start(self) -> list[Question]:
        """Return the questions about the start state; `finish_tick` makes its record."""
        self.frames.ask(self.keys)
        self._asked = model_questions.questions(self.episode, self.spec, self.simulation)
        return self._asked

    def begin_tick(self, now: float) -> list[Question]:
        """Play the timestep that is due; returns what the models are asked about the new state."""
        return self.follow(self.simulation.step(self.decide(now)))

    def decide(self, now: float) -> tuple[int, int]:
        """Return the joint action of the timestep that is due: the newest keys, the partner's decided action."""
        self._late_ms = max(0.0, (now - self.next_deadline) * 1000)
        self.phase, self.stored = "running", False
        return self._joint_action()

    def follow(self, step: SimulatedStep) -> list[Question]:
        """Record that the simulation has made this step. Return what the models are asked about the new state; nothing
        when the episode is over with it."""
        self._step = step
        self.next_deadline = self._zero + (self.simulation.timestep + 1) * self.tick_s
        self.frames.watch()
        if self.tutor is not None:
            self.tutor.watch(self.simulation, self._step)
        self._asked = [] if self.over else model_questions.questions(self.episode, self.spec, self.simulation)
        return self._asked

    def _joint_action(self) -> tuple[int, int]:
        actions = [STAY if action is None else action for action in self.next_actions]
        self._keys_used, coming = (), self.simulation.timestep + 1
        for seat, keys in self.keys.items():
            self._applied[seat] = keys.seq
            actions[seat], press = keys.take(coming)
            if press is not None:
                received_ms = round((press.received - self._zero) * 1000, 3)
                self._keys_used += (KeyRecord(seat, press.keys.seq, press.keys.client_ms, received_ms),)
        self.frames.ask(self.keys)
        return actions[0], actions[1]

    def finish_tick(
        self,
        decisions: Sequence[Decision | None],
        models_ms: float,
        grace_ms: float = 0.0,
        unix_ms: float | None = None,
    ) -> TickRecord:
        """Return what there is to store about the state that `begin_tick` or `begin_start` made. `decisions`: None for
        one that did not come by the deadline. `models_ms`: how long this game and others waited. `grace_ms`: how much
        longer than in a study the models may take, where no person waits. `unix_ms`: the wall clock."""
        models_late = models_ms > self.spec.deadline_ms + grace_ms  # perhaps only those of another game
        answers = model_questions.answers(self._asked, decisions)
        self.next_actions, self.late = answers.next_actions, answers.late
        self.frames.decide(answers, self.over, models_late)
        timestep, step = self.simulation.timestep, self._step
        self.record = TickRecord(
            episode=self.episode,
            timestep=timestep,
            actions=step.actions if timestep else None,
            state_hash=self.simulation.hash(),
            rewards=step.rewards,
            shaped=step.shaped,
            events=step.events,
            next_actions=self.next_actions,
            prediction=answers.prediction,
            displayed=self.frames.displayed,
            keys=self._keys_used,
            scheduled_ms=timestep * float(self.spec.tick_ms),
            late_ms=round(self._late_ms, 3),
            models_ms=round(models_ms, 3),
            late=answers.late,
            made_unix_ms=unix_ms,
            inputs=self.settled_inputs(),
            asked=self.frames.asked,
            in_sight=self.frames.in_sight,
            misleading=self.frames.misleading,
            intentions=answers.intentions,
            displayed_intention=self.frames.intention if self.spec.shows_intention else None,
        )
        return self.record

    # Messages to participants

    def tick_message(self, person: int) -> messages.Tick:
        """Return the frame of the current state. Only for a state that is stored."""
        return self.frames.tick(person, self._applied[person], self.late)

    def welcome(self, person: int) -> messages.Welcome:
        return self.frames.welcome(person, self.episode, resumed=self.stored and self.simulation.timestep > 0)

    def paused(self, person: int, now: float) -> messages.Paused:
        left_s = self.pause_reasons.left_s(now)
        reason = cast(messages.PauseReason, self.pause_reasons.reason(person))
        return messages.Paused(reason, 0.0 if left_s is None else round(max(0.1, left_s), 1))

    def lesson(self) -> messages.Lesson | None:
        """Return which lesson is being taught; None outside a tutorial."""
        if self.tutor is None:
            return None
        lessons = self.tutor.lessons
        index = min(self.tutor.index, len(lessons) - 1)
        return messages.Lesson(lessons[index], index, len(lessons), self.tutor.finished)

    # The end

    def result(self, status: Literal["done", "aborted"] = "done", reason: str = "") -> EpisodeResult:
        """Return how the episode ends now. `passed`: played to its end; a tutorial with all of its lessons."""
        self.phase = "ended"
        for keys in self.keys.values():
            keys.clear(ENDED)
        passed = status == "done" and (self.spec.kind != "tutorial" or self._learnt())
        credit = progress_credit(
            self.simulation.layout, self.simulation.players(), self.simulation.contents(), self.spec.progress
        )
        default = "horizon" if self.spec.horizon and self.simulation.timestep >= self.spec.horizon else "lessons"
        return EpisodeResult(
            episode=self.episode,
            status=status,
            reason=reason or default,
            score=self.simulation.score,
            soups=self.simulation.soups,
            progress=credit,
            passed=passed,
            final_hash=self.simulation.hash(),
            inputs=self.settled_inputs(),
        )

    def _learnt(self) -> bool:
        return self.tutor.finished if self.tutor is not None else self.simulation.soups > 0  # nothing to teach
