import asyncio
import os
import random
import signal
import subprocess
import sys
import time
from dataclasses import replace
from datetime import timedelta
from pathlib import Path

import pytest
from msgspec import structs
from sqlalchemy import create_engine, delete

from overcooked.score import ProgressWeights
from server.play.episode_spec import PauseLimits
from server.play.recorder import EpisodeRecord, EpisodeResult, KeyRecord, PauseRecord, RecorderDown
from server.store import episodes, studies, ticks
from server.store.database import Database
from server.store.episodes import BrokenEpisode, NewEpisode
from server.store.migrate import migrate
from server.store.store_recorder import StoreRecorder, TickConflict
from server.store.tables import ticks as tick_table
from server.store.withdrawal import withdraw
from tests.support.postgres_server import PostgresServer
from tests.support.study_data import SPEC, START, new_participant, played, result_of

WRITER = Path(__file__).parents[2] / "support" / "writes_until_killed.py"
HORIZON = 400  # as in WRITER


@pytest.fixture
def episode(database: Database) -> str:
    return database.write_now(episodes.create, NewEpisode(SPEC, "episode-01"))


@pytest.fixture
def recorder(database: Database) -> StoreRecorder:
    return StoreRecorder(database, patience_s=30)


def loaded(database: Database, episode: str) -> EpisodeRecord:
    record = database.read_now(episodes.load, episode)
    assert record is not None
    return record


async def test_every_tick_comes_back_as_it_was(database: Database, recorder: StoreRecorder, episode: str) -> None:
    records = played(episode)
    await recorder.ticks(records)
    assert database.read_now(ticks.of_episode, episode) == records


async def test_both_seats_keys_and_a_tick_without_anything_come_back(
    database: Database, recorder: StoreRecorder, episode: str
) -> None:
    keys = (KeyRecord(0, 2**53 - 1, 1e15, -3.25), KeyRecord(1, 0, 0.0, 0.5))
    bare = structs.replace(played(episode, 0)[0], prediction=(), displayed=(), next_actions=(None, None))
    full = structs.replace(played(episode, 1)[1], keys=keys)
    await recorder.ticks([bare, full])
    assert database.read_now(ticks.of_episode, episode) == [bare, full]


def test_episode_that_is_loaded_equals_what_was_drawn_up(database: Database) -> None:
    spec = replace(
        SPEC,
        kind="tutorial",
        agents=("fcp", None),
        pause=PauseLimits(1.5, 2.5),
        progress=ProgressWeights(1.0, 2.5),
        lessons=("walk",),
    )
    study = database.write_now(studies.register, "ring", "text").id
    person = database.write_now(new_participant, study)
    episode = database.write_now(episodes.create, NewEpisode(spec, "tutorial", (None, person), study, "tom"))
    record = loaded(database, episode)
    assert record == EpisodeRecord(episode, (None, person), spec, (), None, "new", 0.0)


async def test_episode_continues_after_its_last_stored_tick(
    database: Database, recorder: StoreRecorder, episode: str
) -> None:
    records = played(episode, 12)
    await recorder.ticks(records)
    await recorder.pause(PauseRecord(episode, 3, "blur", START, 100.0))
    await recorder.pause(PauseRecord(episode, 3, "database", START.replace(hour=13), 5000.0))
    record = loaded(database, episode)
    assert record.joint_actions == tuple(tick.actions for tick in records[1:])
    assert (record.last_hash, record.status) == (records[-1].state_hash, "running")
    assert (record.next_actions, record.displayed) == (records[-1].next_actions, records[-1].displayed)
    assert record.paused_ms == 100.0


async def test_tick_stored_twice_is_stored_once(database: Database, recorder: StoreRecorder, episode: str) -> None:
    records = played(episode, 5)
    await recorder.ticks(records[:3])
    await recorder.ticks(records)
    await recorder.ticks(records)
    assert database.read_now(ticks.of_episode, episode) == records


async def test_other_tick_in_its_place_is_refused_and_the_rest_of_the_batch_is_stored(
    database: Database, recorder: StoreRecorder, episode: str
) -> None:
    neighbour = database.write_now(episodes.create, NewEpisode(SPEC, "episode-02"))
    first = played(episode, 0)
    await recorder.ticks(first)
    forged = structs.replace(first[0], late_ms=first[0].late_ms + 1)
    with pytest.raises(TickConflict, match=f"episode {episode} timestep 0"):
        await recorder.ticks([*played(neighbour, 0), forged])
    assert database.read_now(ticks.of_episode, episode) == first
    assert database.read_now(ticks.of_episode, neighbour) == played(neighbour, 0)


async def test_ticks_of_somebody_who_withdrew_are_dropped_and_the_others_kept(
    database: Database, recorder: StoreRecorder, episode: str
) -> None:
    study = database.write_now(studies.register, "ring", "text").id
    person = database.write_now(new_participant, study)
    theirs = database.write_now(episodes.create, NewEpisode(SPEC, "episode-01", (person, None), study))
    database.write_now(withdraw, person)
    await recorder.ticks([*played(theirs, 3), *played(episode, 3)])
    assert database.read_now(ticks.of_episode, theirs) == []
    assert database.read_now(ticks.of_episode, episode) == played(episode, 3)


def test_two_keys_of_one_seat_in_one_tick_are_refused(episode: str) -> None:
    twice = (KeyRecord(0, 1, 0, 0), KeyRecord(0, 2, 0, 0))
    with pytest.raises(ValueError, match="two keys of seat 0"):
        ticks.row_of(structs.replace(played(episode, 1)[1], keys=twice))


async def test_messages_report_the_begin_and_the_end_of_a_pause(
    database: Database, recorder: StoreRecorder, episode: str
) -> None:
    lasting = PauseRecord(episode, 3, "hidden", START, None, seat=1)
    await recorder.pause(lasting)
    assert database.read_now(episodes.pauses_of, episode) == [lasting]
    over = replace(lasting, duration_ms=812.5)
    for _ in range(2):
        await recorder.pause(over)
    assert database.read_now(episodes.pauses_of, episode) == [over]


async def test_an_absence_cut_off_by_a_dying_server_ends_with_the_next_ones_pause_and_is_nobodys_fault(
    database: Database, recorder: StoreRecorder, episode: str
) -> None:
    await recorder.pause(PauseRecord(episode, 2, "blur", START, 40.0))
    away = PauseRecord(episode, 3, "lost", START + timedelta(seconds=1), None, seat=1)
    await recorder.pause(away)
    taken_up = PauseRecord(episode, 3, "server", START + timedelta(seconds=61.25), None)
    await recorder.pause(taken_up)
    cut_off = replace(away, duration_ms=60_250.0, away_ms=0.0)
    assert database.read_now(episodes.pauses_of, episode)[1:] == [cut_off, taken_up]
    record = database.read_now(episodes.load, episode)
    assert record is not None
    assert record.paused_ms == 40.0


async def test_a_researchers_pause_during_an_absence_does_not_count_as_absence(
    database: Database, recorder: StoreRecorder, episode: str
) -> None:
    began_as_absence = PauseRecord(episode, 2, "hidden", START, 600_000.0, away_ms=4000.0)
    became_absence = PauseRecord(episode, 3, "researcher", START + timedelta(hours=1), 60_000.0, away_ms=2500.0)
    for pause in (began_as_absence, became_absence):
        await recorder.pause(replace(pause, duration_ms=None, away_ms=None))
        await recorder.pause(pause)
    assert database.read_now(episodes.pauses_of, episode) == [began_as_absence, became_absence]
    record = database.read_now(episodes.load, episode)
    assert record is not None
    assert record.paused_ms == 6500.0


async def test_first_end_of_an_episode_stays(database: Database, recorder: StoreRecorder, episode: str) -> None:
    records = played(episode)
    await recorder.ticks(records)
    result = result_of(records)
    await recorder.end(result)
    await recorder.end(EpisodeResult(episode, "aborted", "late", 0, 0, 0.0, False, "0" * 16))
    found = database.read_now(episodes.get, episode)
    assert found is not None
    assert (found.status, found.end_reason, found.score, found.soups) == ("done", "horizon", result.score, result.soups)
    assert (found.progress, found.passed, found.final_hash) == (result.progress, True, result.final_hash)
    assert database.read_now(episodes.unfinished) == []


def test_attempts_at_a_step_are_counted_and_the_latest_is_found(database: Database) -> None:
    study = database.write_now(studies.register, "ring", "text").id
    person = database.write_now(new_participant, study)
    assert database.read_now(episodes.of_step, person, "tutorial") is None
    for attempt in (1, 2):
        made = database.write_now(episodes.create, NewEpisode(SPEC, "tutorial", (person, None), study))
        found = database.read_now(episodes.of_step, person, "tutorial")
        assert found is not None
        assert (found.id, found.attempt) == (made, attempt)
    assert len(database.read_now(episodes.of_participant, person)) == 2
    assert len(database.read_now(episodes.unfinished, study)) == 2


async def test_hole_in_the_ticks_is_reported_with_its_place(
    database: Database, recorder: StoreRecorder, episode: str
) -> None:
    await recorder.ticks(played(episode, 9))
    database.write_now(lambda connection: connection.execute(delete(tick_table).where(tick_table.c.timestep == 4)))
    with pytest.raises(BrokenEpisode, match=f"episode {episode} has no tick 4"):
        database.read_now(episodes.load, episode)


async def test_database_that_takes_too_long_is_down_and_the_same_call_works_later(tmp_path: Path) -> None:
    url = f"sqlite:///{tmp_path}/study.db"
    migrate(url)
    with Database(url) as database:
        episode = database.write_now(episodes.create, NewEpisode(SPEC, "episode-01"))
        impatient = StoreRecorder(database, patience_s=0.1)
        intruder = create_engine(url, isolation_level="AUTOCOMMIT")
        with intruder.connect() as connection:
            connection.exec_driver_sql("BEGIN IMMEDIATE")
            for _ in range(3):
                with pytest.raises(RecorderDown, match="did not commit"):
                    await impatient.ticks(played(episode, 1))
            connection.exec_driver_sql("ROLLBACK")
        intruder.dispose()
        await StoreRecorder(database, patience_s=30).ticks(played(episode, 1))
        assert database.read_now(ticks.of_episode, episode) == played(episode, 1)


async def test_full_disk_counts_as_down_until_there_is_space_again(tmp_path: Path) -> None:
    url = f"sqlite:///{tmp_path}/study.db"
    migrate(url)
    with Database(url) as database:
        recorder = StoreRecorder(database, patience_s=30)
        episode = database.write_now(episodes.create, NewEpisode(SPEC, "episode-01"))
        size = database.write_now(lambda connection: connection.exec_driver_sql("PRAGMA page_count").scalar_one())
        database.write_now(lambda connection: connection.exec_driver_sql(f"PRAGMA max_page_count={size + 2}"))
        records = played(episode, 400)
        with pytest.raises(RecorderDown, match="full"):
            await recorder.ticks(records)
        assert database.read_now(ticks.of_episode, episode) == []
        await recorder.ticks(records)  # the connection was made again, without the limit
        assert database.read_now(ticks.of_episode, episode) == records


@pytest.mark.postgres
async def test_stopped_postgresql_acknowledges_nothing_and_then_recovers() -> None:
    server = PostgresServer()
    try:
        url = server.url(server.new_database())
        migrate(url)
        with Database(url) as database:
            recorder = StoreRecorder(database, patience_s=0.2)
            episode = await database.write(episodes.create, NewEpisode(SPEC, "episode-01"))
            records = played(episode, 20)
            await recorder.ticks(records[:10])
            server.freeze()
            with pytest.raises(RecorderDown):
                await recorder.ticks(records[10:])
            server.thaw()
            await asyncio.sleep(0.1)
            await recorder.ticks(records[10:])
            server.stop()
            with pytest.raises(RecorderDown):
                await recorder.ticks(records[10:])
            server.start()
            await StoreRecorder(database, patience_s=30).ticks(records)
            assert await database.read(ticks.of_episode, episode) == records
    finally:
        server.remove()


def test_no_acknowledged_tick_is_lost_when_the_server_is_killed(url: str) -> None:
    chance = random.Random(6)
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(sys.path)}
    acknowledged: dict[str, int] = {}
    for _ in range(3):
        process = subprocess.Popen([sys.executable, WRITER, url], stdout=subprocess.PIPE, text=True, env=environment)
        assert process.stdout is not None
        assert process.stdout.readline() == "ready\n"
        time.sleep(chance.uniform(0.01, 0.15))
        process.send_signal(signal.SIGKILL)
        lines = process.stdout.read().splitlines(keepends=True)
        process.stdout.close()
        process.wait()
        for line in lines:
            if line.endswith("\n"):
                episode, timestep = line.split()
                acknowledged[episode] = max(acknowledged.get(episode, -1), int(timestep))
    assert acknowledged
    with Database(url, read_only=True) as database:
        for episode, last in acknowledged.items():
            stored = database.read_now(ticks.of_episode, episode)
            assert len(stored) > last
            assert stored == played(episode, HORIZON)[: len(stored)]


def test_what_threads_convert_to_is_known_before_there_are_threads() -> None:
    """Two threads that were the first to take a game up crashed the server once in some hundred restarts."""
    look = "from server.store import episodes as e; print('__msgspec_cache__' in vars(e.EpisodeSpec))"
    found = subprocess.run([sys.executable, "-c", look], capture_output=True, text=True, check=True)
    assert found.stdout == "True\n"
