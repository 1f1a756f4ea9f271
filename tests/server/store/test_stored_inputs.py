"""Every input is stored once with its outcome, in the transaction in which the outcome is known."""

from dataclasses import replace
from datetime import UTC, datetime, timedelta

import pytest
from msgspec import structs
from sqlalchemy import func, select

from server.play.recorder import InputRecord, PauseRecord, StoredInputs
from server.store import episodes, inputs, studies, ticks
from server.store.database import Database
from server.store.episodes import NewEpisode
from server.store.store_recorder import StoreRecorder
from server.store.tables import inputs as table
from server.store.withdrawal import withdraw
from tests.support.study_data import SPEC, new_participant, played, result_of, sent

AT = datetime(2026, 3, 1, tzinfo=UTC)


@pytest.fixture
def episode(database: Database) -> str:
    study = database.write_now(studies.register, "ring", "text").id
    person = database.write_now(new_participant, study)
    return database.write_now(episodes.create, NewEpisode(SPEC, "episode-01", (person, None), study))


def one(episode: str, number: int, **changes: object) -> InputRecord:
    made = InputRecord(episode, 0, number, "tab-0001", number, 2, None, 1.5, 1.75e12 + number, 3.25, number, "applied")
    return structs.replace(made, **changes)  # type: ignore[arg-type]


async def test_inputs_come_with_ticks_pauses_and_the_end_and_repeating_a_call_changes_nothing(
    database: Database, episode: str
) -> None:
    recorder = StoreRecorder(database, patience_s=30)
    records = [structs.replace(record, inputs=sent(record)) for record in played(episode)]
    pause = PauseRecord(episode, 40, "blur", AT, None, (one(episode, 200, outcome="forgotten", timestep=None),))
    over = replace(pause, duration_ms=5.0, inputs=(one(episode, 201, seat=1, received_ms=None, held=None),))
    result = replace(result_of(records), inputs=(one(episode, 202, outcome="ended", timestep=None),))
    for _ in range(2):
        await recorder.ticks(records)
        await recorder.pause(pause)
        await recorder.pause(over)
        await recorder.end(result)
    wanted = [*(input for record in records for input in record.inputs), *pause.inputs, *over.inputs, *result.inputs]
    found = database.read_now(inputs.of_episode, episode)
    assert sorted(found, key=lambda record: record.number) == sorted(wanted, key=lambda record: record.number)


async def test_inputs_of_a_paused_game_are_stored_separately_and_none_of_a_deleted_episode(
    database: Database, episode: str
) -> None:
    recorder = StoreRecorder(database, patience_s=30)
    came = (one(episode, 1, outcome="stood_still", timestep=None), one(episode, 2, outcome="unchanged", timestep=None))
    for _ in range(2):
        await recorder.inputs(episode, came)
        await recorder.inputs("gone", (one("gone", 1),))
    assert database.read_now(inputs.of_episode, episode) == list(came)
    assert database.read_now(inputs.of_episode, "gone") == []


async def test_a_loaded_episode_ignores_messages_that_it_has_already_handled(database: Database, episode: str) -> None:
    seen = (
        one(episode, 1, seq=40),
        one(episode, 2, seq=3, tab="tab-0002"),
        one(episode, 3, seq=0),  # the first tab was loaded again: it counts from the start
        one(episode, 4, seq=0, outcome="repeated", timestep=None),
        one(episode, 1, seat=1, seq=7),
    )
    first, second = played(episode, 1)
    await StoreRecorder(database, patience_s=30).ticks([first, structs.replace(second, inputs=seen)])
    record = database.read_now(episodes.load, episode)
    assert record is not None
    assert record.inputs == {0: StoredInputs(4, {"tab-0001": 0, "tab-0002": 3}), 1: StoredInputs(1, {"tab-0001": 7})}


async def test_inputs_of_a_participant_who_withdraws_are_deleted(database: Database, episode: str) -> None:
    database.write_now(ticks.insert, [structs.replace(record, inputs=sent(record)) for record in played(episode, 3)])
    (person,) = {name for name in database.read_now(episodes.load, episode).participants if name}  # type: ignore[union-attr]
    assert database.write_now(withdraw, person)
    assert (
        database.read_now(lambda connection: connection.execute(select(func.count()).select_from(table)).scalar()) == 0
    )


async def test_it_is_known_until_when_an_episode_was_seen(database: Database, episode: str) -> None:
    recorder = StoreRecorder(database, patience_s=30)

    def known() -> datetime | None:
        record = database.read_now(episodes.load, episode)
        assert record is not None
        return record.known_at

    assert known() is None, "nothing is stored yet"
    records = played(episode, 3)
    await recorder.ticks(records)
    last = records[-1].made_unix_ms
    assert last is not None
    assert known() == datetime.fromtimestamp(last / 1000, UTC)
    later = datetime.fromtimestamp(last / 1000, UTC) + timedelta(seconds=5)
    await recorder.pause(PauseRecord(episode, 3, "blur", later, None))
    assert known() is None, "the pause that is open covers the time since"
    await recorder.pause(PauseRecord(episode, 3, "blur", later, 2500.0))
    assert known() == later + timedelta(seconds=2.5, microseconds=1)
