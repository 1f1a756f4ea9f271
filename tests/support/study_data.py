"""A small study with every kind of record, played by the real rules, for tests of store, export and check."""

import random
from dataclasses import replace
from datetime import UTC, datetime, timedelta

import numpy as np
from msgspec import structs
from sqlalchemy import Connection

from overcooked.constants import ACTIONS, SOUP_DELIVERY
from overcooked.layout import load_layout
from overcooked.score import progress_credit, shaped_reward, sparse_reward
from overcooked.state import Kitchens
from server.play.episode_spec import EpisodeSpec
from server.play.intentions import Intention
from server.play.recorder import EpisodeResult, InputRecord, KeyRecord, PauseRecord, TickRecord
from server.store import answers, audit, episodes, events, participants, studies, ticks
from tests.support.live_fakes import make_spec

START = datetime(2026, 3, 1, 12, 0, 0, 250, tzinfo=UTC)
RING = load_layout("coordination_ring")
SPEC = make_spec(episodes=10, seed=2**63 - 1)


def new_participant(connection: Connection, study_id: int, condition: str = "tom", **known: str) -> str:
    new = participants.NewParticipant(study_id, condition, 2**63 - 1, participants.new_token(), **known)  # type: ignore[arg-type]
    return participants.create(connection, new).id


def played(episode: str, timesteps: int = 40, seed: int = 0, spec: EpisodeSpec = SPEC) -> list[TickRecord]:
    """Ticks 0 to `timesteps` of random actions on the real rules."""
    chance = random.Random(seed)
    kitchens, event_bits = Kitchens.start(RING), np.zeros((1, 2), np.int32)
    records = []
    decided = chance.randrange(ACTIONS)
    for timestep in range(timesteps + 1):
        actions = None
        if timestep:
            actions = (chance.randrange(ACTIONS), decided)
            kitchens.step(np.array([actions]), event_bits)
            decided = chance.randrange(ACTIONS)
        first, second = event_bits[0].tolist()
        late = chance.random() < 0.1
        records.append(
            TickRecord(
                episode=episode,
                timestep=timestep,
                actions=actions,
                state_hash=kitchens.hash(),
                rewards=(sparse_reward(first), sparse_reward(second)),
                shaped=(shaped_reward(first), shaped_reward(second)),
                events=(first, second),
                next_actions=(None, decided),
                prediction=() if late else prediction(chance),
                displayed=((decided, 100), (4, 85), (6, 0)),
                keys=(KeyRecord(0, timestep, timestep * 200.5, timestep * 200.0 + 12.125),) if actions else (),
                scheduled_ms=timestep * 200.0,
                late_ms=chance.random(),
                models_ms=chance.random() * 50,
                late=late,
                made_unix_ms=1_772_366_400_000.0 + timestep * 200.125,
                intentions=() if late else (Intention(4, 3, 0, 5, 0.5), Intention(0, -1, -1, 0, 0.25)),
                displayed_intention=None if late else (8, -1, -1, 95),
            )
        )
    return records


def sent(record: TickRecord) -> tuple[InputRecord, ...]:
    """What a browser sent before this tick: a key that counted, a repeat of it, and one while the game stood still."""
    n = record.timestep
    first = InputRecord(
        record.episode, 0, 3 * n + 1, "tab-0001", n, 2, 5, n * 200.5, 1.75e12 + n, n - 0.5, n, "applied"
    )
    again = structs.replace(first, number=3 * n + 2, timestep=None, outcome="repeated")
    tap = structs.replace(
        first, number=3 * n + 3, seq=n + 1, held=None, received_ms=None, timestep=None, outcome="stood_still"
    )
    return (first, again, tap) if n else ()


def prediction(chance: random.Random) -> tuple[tuple[float, ...], ...]:
    """3 x 6 probabilities that 32 bits hold exactly."""
    return tuple(tuple(float(np.float32(chance.random() / 6)) for _ in range(ACTIONS)) for _ in range(3))


def result_of(records: list[TickRecord], spec: EpisodeSpec = SPEC) -> EpisodeResult:
    """How an episode with these ticks ended, by the rules."""
    kitchens, event_bits = Kitchens.start(RING), np.zeros((1, 2), np.int32)
    soups = 0
    for record in records[1:]:
        kitchens.step(np.array([record.actions]), event_bits)
        soups += sum(bool(bits & SOUP_DELIVERY) for bits in event_bits[0].tolist())
    progress = progress_credit(RING, kitchens.players[0], kitchens.contents[0], spec.progress)
    score = sum(sum(record.rewards) for record in records)
    return EpisodeResult(records[0].episode, "done", "horizon", score, soups, progress, True, records[-1].state_hash)


def fill(connection: Connection, people: int = 3, per_person: int = 2, key: str = "ring", timesteps: int = 40) -> int:
    """A study with people, episodes and all that is recorded with them; returns its id."""
    study = studies.register(connection, key, f"name: {key}\ntitle: =not a formula\n")
    for person in range(people):
        condition = ("none", "random", "tom")[person % 3]
        participant = new_participant(connection, study.id, condition, recruitment_id=f"PROLIFIC{key}{person:06d}")
        answers.enter(connection, participant, "consent")
        answers.leave(connection, participant, "consent")
        for number in range(1, per_person + 1):
            _play(connection, study.id, participant, condition, number, timesteps, seed=100 * person + number)
        answers.save(
            connection,
            answers.SubmittedPage(participant, "end", {"comment": "=1+1", "agree": True, "ways": ["a", "-b"]}),
        )
        events.add(connection, events.Event("reload", START, participant, detail={"page": "consent"}))
        if person == 0:
            participants.complete(connection, participant, "KM-1234")
    audit.add(connection, "anna", "pause_study", {"study": study.id})
    return study.id


def _play(
    connection: Connection, study_id: int, participant: str, condition: str, number: int, timesteps: int, seed: int
) -> None:
    spec = replace(SPEC, number=number, seed=seed, horizon=timesteps)
    step = f"episode-{number:02d}"
    new = episodes.NewEpisode(spec, step, (participant, None), study_id, condition, (None, "ab" * 32), "cd" * 32, "1.0")
    episode = episodes.create(connection, new)
    records = played(episode, timesteps, seed)
    ticks.insert(connection, [structs.replace(record, inputs=sent(record)) for record in records])
    episodes.pause(connection, PauseRecord(episode, 7, "blur", START + timedelta(seconds=number), 1234.5, seat=0))
    events.add(connection, events.Event("rtt", START, participant, episode, {"ms": 12.5}))
    episodes.end(connection, result_of(records, spec))
    answers.save(
        connection,
        answers.SubmittedPage(participant, f"questions-{number:02d}", {"partner": 7, "predictor": -1}, episode, 5e3),
    )
