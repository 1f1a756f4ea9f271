"""Invariants that must hold after any fault: the clients' journals are compared with the database.

I1 what was acknowledged is stored exactly once; I2 timesteps have neither hole nor duplicate; I3 re-simulating the log
gives the states that people saw; I4 one row a person, one seat a game; I7 nobody was told something false.
I5 (other games on time) and I6 (nothing is left behind) are measured where a fault is made: `lateness_ms`, `Holdings`.
"""

from collections import defaultdict
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from itertools import pairwise
from pathlib import Path
from typing import Any

from sqlalchemy import Connection, func, select

from server.store.database import Database
from server.store.tables import answers, episodes, participants, ticks
from server.verification import verify_all
from tests.support.faults.recording_client import ClientLog, LogEntry, RecordingClient

SILENCE_S = 2.5  # a game that stopped for so long without a message counts as a violation


@dataclass
class Findings:
    """The violations, by invariant; `ok` if there are none."""

    lost: list[str] = field(default_factory=list)  # I1
    doubled: list[str] = field(default_factory=list)  # I1
    holes: list[str] = field(default_factory=list)  # I2
    mismatches: list[str] = field(default_factory=list)  # I3
    people: list[str] = field(default_factory=list)  # I4
    untrue: list[str] = field(default_factory=list)  # I7
    compared: int = 0  # states that somebody saw

    @property
    def ok(self) -> bool:
        return not any((self.lost, self.doubled, self.holes, self.mismatches, self.people, self.untrue))

    def figures(self) -> dict[str, Any]:
        names = ("lost", "doubled", "holes", "mismatches", "people", "untrue")
        counts: dict[str, Any] = {name: len(getattr(self, name)) for name in names}
        examples = [text for name in names for text in getattr(self, name)[:3]]
        return counts | {"compared": self.compared} | ({"examples": examples} if examples else {})


def held_against(url: str, clients: Sequence[RecordingClient], silence_s: float = SILENCE_S) -> Findings:
    """The findings about everything that these clients saw of the database at `url`."""
    found = Findings()
    with Database(url, read_only=True) as database:
        for check in (_timesteps, _inputs, _ends, _pages, _people):
            database.read_now(check, clients, found)
        for result in database.read_now(lambda connection: list(verify_all(connection))):
            if result.difference is not None:
                found.mismatches.append(f"{result.episode} at {result.timestep}: {result.difference}")
    for client in clients:
        found.untrue += [*client.log.violations, *untrue(client.log, silence_s)]
    return found


def _timesteps(connection: Connection, clients: Sequence[RecordingClient], found: Findings) -> None:
    query = select(ticks.c.episode_id, ticks.c.timestep, ticks.c.state_hash).order_by(*ticks.primary_key.columns)
    stored = {(row.episode_id, row.timestep): row.state_hash.hex() for row in connection.execute(query)}
    lasts: dict[str, list[int]] = defaultdict(list)
    for episode, timestep in stored:
        lasts[episode].append(timestep)
    found.holes += [episode for episode, timesteps in lasts.items() if timesteps != list(range(len(timesteps)))]
    for client in clients:
        found.compared += len(client.log.states)
        for place, seen in client.log.states.items():
            if place not in stored:
                found.lost.append(f"{place} was shown and is not stored")
            elif stored[place] != seen:
                found.mismatches.append(f"{place} was shown as {seen} and is stored as {stored[place]}")


def _inputs(connection: Connection, clients: Sequence[RecordingClient], found: Findings) -> None:
    """A tap moves once, and only the sender's chef."""
    sent: dict[str, dict[int, int]] = defaultdict(dict)
    for client in clients:
        for episode, seq, tap in client.log.inputs:
            sent[episode][seq] = tap
    moved: set[tuple[str, int, int]] = set()
    query = select(ticks).order_by(*ticks.primary_key.columns)
    for row in connection.execute(query):
        for seat, seq, action in ((0, row.key_seq_0, row.action_0), (1, row.key_seq_1, row.action_1)):
            if seq is None or row.episode_id not in sent:
                continue
            place = f"{row.episode_id} timestep {row.timestep}"
            if sent[row.episode_id].get(seq) != action:
                found.doubled.append(f"{place}: input {seq} moved {action}, which nobody sent")
            if (row.episode_id, seat, seq) in moved:
                found.doubled.append(f"{place}: input {seq} moved a second time")
            moved.add((row.episode_id, seat, seq))


def _ends(connection: Connection, clients: Sequence[RecordingClient], found: Findings) -> None:
    ended = {row.id: row for row in connection.execute(select(episodes))}
    for client in clients:
        for episode, end in client.log.ended.items():
            row = ended.get(episode)
            if row is None or row.status not in ("done", "aborted"):
                found.lost.append(f"the end of {episode} was told and is not stored")
            elif (row.score, row.soups) != (end.score, end.soups):
                found.mismatches.append(f"{episode} ended with {end.score}, stored is {row.score}")


def _pages(connection: Connection, clients: Sequence[RecordingClient], found: Findings) -> None:
    """Every accepted page of questions is stored, and nobody has a code without all of them."""
    by_code = {row.completion_code: row.id for row in connection.execute(select(participants)) if row.completion_code}
    query = select(answers.c.participant_id, answers.c.step_key, func.count()).group_by(
        answers.c.participant_id, answers.c.step_key
    )
    stored: dict[str, set[str]] = defaultdict(set)
    for participant, step, _ in connection.execute(query):
        stored[participant].add(step)
    for client in clients:
        code = client.log.code
        if code is None:
            continue
        if code not in by_code:
            found.lost.append(f"the code {code} was shown and is not stored")
            continue
        asked = {step for step in client.log.submitted if step.startswith("questionnaire")}
        missing = {step for step in asked if step not in stored[by_code[code]]}
        found.lost += [f"{code}: the answers of {step} were taken in and are not stored" for step in missing]


def _people(connection: Connection, clients: Sequence[RecordingClient], found: Findings) -> None:
    rows = connection.execute(select(func.count()).select_from(participants)).scalar_one()
    if rows != len(clients):
        found.people.append(f"{len(clients)} people consented, {rows} are stored")
    live = select(episodes.c.participant_0, episodes.c.step_key, func.count())
    live = live.where(episodes.c.status.in_(("new", "running"))).group_by(episodes.c.participant_0, episodes.c.step_key)
    for participant, step, count in connection.execute(live):
        if count > 1:
            found.people.append(f"{participant} has {count} games at {step}")
    codes = [client.log.code for client in clients if client.log.code]
    if len(codes) != len(set(codes)):
        found.people.append("two people have one code")


def untrue(log: ClientLog, silence_s: float = SILENCE_S) -> list[str]:
    """Return false messages to participants: a game that moved while reported as paused, or that stopped without a
    message."""
    lines: dict[int, list[LogEntry]] = defaultdict(list)
    for told in log.entries:
        lines[told.line].append(told)
    return [fault for said in lines.values() for fault in _untrue_of(said, silence_s)]


def _untrue_of(said: Sequence[LogEntry], silence_s: float) -> list[str]:
    """On one connection."""
    faults = []
    stands, newest, running = True, -1, None
    for told in said:
        if told.kind in ("open", "closed", "paused", "superseded", "welcome"):
            stands, running = True, None
            newest = told.detail if told.kind == "welcome" else newest
        elif told.kind == "countdown":
            stands = False
        elif told.kind == "tick":
            moved = newest >= 0 and told.detail > newest
            if moved and stands:
                faults.append(f"timestep {told.detail} came while the game was said to stand still")
            if moved and running is not None and told.at - running > silence_s:
                faults.append(f"nothing was said for {told.at - running:.1f} s before timestep {told.detail}")
            running = told.at if moved else running
            newest = max(newest, told.detail)
    return faults


def lateness_ms(url: str, episodes_of: Iterable[str] | None = None, since_ms: float = 0.0) -> list[float]:
    """I5: how late each stored timestep began, of these episodes or all. `since_ms`: made at or after this Unix time;
    the database returns rows in no particular order, so a period is never a slice of them."""
    wanted = None if episodes_of is None else set(episodes_of)
    query = select(ticks.c.episode_id, ticks.c.late_ms).where(ticks.c.made_unix_ms >= since_ms)
    with Database(url, read_only=True) as database:
        rows = database.read_now(lambda connection: connection.execute(query).all())
    return [late for episode, late in rows if wanted is None or episode in wanted]


def p99(values: Sequence[float]) -> float:
    ordered = sorted(values)
    return ordered[min(len(ordered) - 1, int(0.99 * len(ordered)))] if ordered else 0.0


@dataclass(frozen=True)
class Holdings:
    """I6: the resources of a process."""

    descriptors: int
    sockets: int
    rss_kib: int

    @property
    def files(self) -> int:
        """Return the descriptors that are not sockets."""
        return self.descriptors - self.sockets

    @classmethod
    def of(cls, pid: int) -> "Holdings":
        links = []
        for descriptor in Path(f"/proc/{pid}/fd").iterdir():
            try:
                links.append(str(descriptor.readlink()))
            except OSError:
                continue
        status = dict(line.split(":", 1) for line in Path(f"/proc/{pid}/status").read_text().splitlines())
        return cls(len(links), sum(link.startswith("socket:") for link in links), int(status["VmRSS"].split()[0]))


def gaps_s(log: ClientLog, kind: str = "tick") -> list[float]:
    """Seconds between messages of a kind."""
    times = [told.at for told in log.entries if told.kind == kind]
    return [later - earlier for earlier, later in pairwise(times)]


def longest(values: Iterable[float], otherwise: Any = 0.0) -> float:
    return max(values, default=otherwise)
