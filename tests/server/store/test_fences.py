"""When several processes serve, only the newest owner of a game may store its ticks."""

import asyncio
import threading
from collections.abc import Iterator

import pytest
from msgspec import structs
from sqlalchemy import Connection

from server.play.recorder import EpisodeResult, GamesLost, PauseRecord, TickRecord
from server.store import episodes, fences, ticks
from server.store.database import Database
from server.store.engines import DatabaseInUse
from server.store.fences import FencedRecorder
from tests.support.postgres_pool import PostgresPool
from tests.support.study_data import SPEC, played

pytestmark = pytest.mark.postgres
NEW = episodes.NewEpisode(SPEC, "episode-01")


def a_tick(episode: str, timestep: int) -> TickRecord:
    return played(episode, timestep)[timestep]


@pytest.fixture
def address(postgres_pool: PostgresPool) -> Iterator[str]:
    with postgres_pool.one() as address:
        yield address


@pytest.fixture
def two(address: str) -> Iterator[tuple[Database, Database]]:
    """The same database in two processes."""
    with Database(address, shared=True) as one, Database(address, shared=True) as other:
        yield one, other


async def test_ticks_of_an_older_owner_are_refused_and_the_others_of_its_batch_stored(
    two: tuple[Database, Database],
) -> None:
    one, other = (FencedRecorder(database) for database in two)
    lost, kept = [await two[0].write(episodes.create, NEW) for _ in range(2)]
    for episode in (lost, kept):
        assert await one.take(episode) is not None
    await one.ticks([a_tick(lost, 0), a_tick(kept, 0)])
    record = await other.take(lost)
    assert record is not None
    assert record.last_hash == a_tick(lost, 0).state_hash
    assert not await one.still_mine(lost)
    assert await one.still_mine(kept)
    with pytest.raises(GamesLost) as found:
        await one.ticks([a_tick(lost, 1), a_tick(kept, 1)])
    assert found.value.episodes == {lost}
    await other.ticks([structs.replace(a_tick(lost, 1), actions=(5, 5))])
    assert [tick.timestep for tick in await two[0].read(ticks.of_episode, kept)] == [0, 1]
    assert (await two[0].read(ticks.of_episode, lost))[1].actions == (5, 5)


async def test_an_older_owner_can_neither_pause_nor_end_a_game(two: tuple[Database, Database]) -> None:
    one, other = (FencedRecorder(database) for database in two)
    episode = await two[0].write(episodes.create, NEW)
    await one.take(episode)
    await other.take(episode)
    result = EpisodeResult(episode, "done", "horizon", 20, 1, 0.0, True, "0" * 16)
    started = (await two[0].read(episodes.get, episode)).created_at  # type: ignore[union-attr]
    await one.pause(PauseRecord(episode, 0, "lost", started, None))
    with pytest.raises(GamesLost):
        await one.end(result)
    assert await two[0].read(episodes.pauses_of, episode) == []
    await other.end(result)
    ended = await two[0].read(episodes.get, episode)
    assert ended is not None
    assert ended.status == "done"


async def test_taking_over_a_game_waits_for_the_commit_in_progress(two: tuple[Database, Database]) -> None:
    one, other = two
    episode = await one.write(episodes.create, NEW)
    fence, _ = await one.write(fences.take, episode)  # type: ignore[misc]
    on_its_way, may_end = threading.Event(), threading.Event()

    def slow(connection: Connection) -> None:
        fences.store_ticks(connection, [a_tick(episode, 0)], {episode: fence})
        on_its_way.set()
        may_end.wait(10)

    storing = asyncio.create_task(one.write(slow))
    await asyncio.to_thread(on_its_way.wait, 10)
    taking = asyncio.create_task(other.write(fences.take, episode))
    await asyncio.sleep(0.2)
    assert not taking.done()
    may_end.set()
    await storing
    taken = await taking
    assert taken is not None
    assert taken[1].last_hash == a_tick(episode, 0).state_hash


async def test_a_deleted_game_has_no_owner_and_is_not_an_error(two: tuple[Database, Database]) -> None:
    recorder = FencedRecorder(two[0])
    assert await recorder.take("gone") is None
    await recorder.ticks([a_tick("gone", 0)])


def test_a_server_of_one_process_is_kept_out_while_several_run(two: tuple[Database, Database]) -> None:
    with pytest.raises(DatabaseInUse):
        Database(str(two[0].url.render_as_string(hide_password=False)))


async def test_ordered_writes_keep_their_order_across_two_processes(address: str) -> None:
    """Numbers of participants, attempts, quotas: read, then written."""
    with (
        Database(address, shared=True, in_turn=True) as one,
        Database(address, shared=True, in_turn=True) as other,
    ):
        inside, most = [0], [0]

        def count(_: Connection) -> None:
            inside[0] += 1
            most[0] = max(most[0], inside[0])
            threading.Event().wait(0.02)
            inside[0] -= 1

        await asyncio.gather(*(database.write(count) for _ in range(5) for database in (one, other)))
        assert most[0] == 1
