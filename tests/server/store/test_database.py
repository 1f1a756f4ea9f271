"""The database: migrations, shared commits, locks, and what happens when it is away."""

import asyncio
import math
import threading
from pathlib import Path

import psycopg
import pytest
from alembic.autogenerate import compare_metadata
from alembic.migration import MigrationContext
from sqlalchemy import Connection, create_engine, event, func, select, text

from server.store import studies
from server.store.database import Database, DatabaseDown, DatabaseInUse
from server.store.engines import normal_url
from server.store.migrate import DatabaseTooNew, migrate, migrate_shared, newest_revision
from server.store.tables import metadata
from server.store.tables import studies as study_table
from tests.support.postgres_server import PostgresServer


def how_many(connection: Connection) -> int:
    return connection.execute(select(func.count()).select_from(study_table)).scalar_one()


def fail_after_writing(connection: Connection) -> None:
    studies.register(connection, "bad", "text")
    raise LookupError("this function is broken")


def test_migrations_lead_to_exactly_the_tables_of_the_code(url: str) -> None:
    engine = create_engine(normal_url(url))
    with engine.connect() as connection:
        context = MigrationContext.configure(connection, opts={"compare_type": True, "compare_server_default": True})
        assert compare_metadata(context, metadata) == []
        assert context.get_current_revision() == newest_revision()
    engine.dispose()


def test_migrating_twice_changes_nothing(url: str) -> None:
    with Database(url) as database:
        database.write_now(studies.register, "ring", "text")
    migrate(url)
    with Database(url) as database:
        assert database.read_now(how_many) == 1


def test_database_of_a_later_version_is_refused(url: str) -> None:
    with Database(url) as database:
        database.write_now(
            lambda connection: connection.execute(text("UPDATE alembic_version SET version_num = '9999'"))
        )
    with pytest.raises(DatabaseTooNew, match="9999"):
        migrate(url)


async def test_what_was_written_is_read_by_everybody(database: Database) -> None:
    study = await database.write(studies.register, "ring", "text")
    assert await database.read(studies.get, study.id) == study
    assert database.read_now(studies.every, "ring") == [study]


@pytest.mark.parametrize("write", [True, False], ids=["writing", "reading"])
def test_an_error_of_the_database_does_not_tell_what_somebody_wrote(database: Database, write: bool) -> None:
    def broken(connection: Connection) -> None:
        connection.execute(text("SELECT * FROM no_such_table WHERE name = :name"), {"name": "Ada Lovelace"})

    with pytest.raises(Exception, match="no_such_table") as caught:
        (database.write_now if write else database.read_now)(broken)
    assert "Ada Lovelace" not in str(caught.value)


async def kept_busy(database: Database) -> tuple[threading.Event, "asyncio.Task[bool]"]:
    """The writer waits for the event, so that later functions gather in a group."""
    gate = threading.Event()
    blocker = asyncio.create_task(database.write(lambda _: gate.wait(10)))
    await asyncio.sleep(0.05)
    return gate, blocker


def counted_commits(database: Database) -> list[int]:
    """A list with an entry for each commit from now on."""
    commits: list[int] = []
    event.listen(database._writer._engine, "commit", lambda _: commits.append(1))
    return commits


async def test_one_failing_function_of_a_group_undoes_only_itself(database: Database) -> None:
    gate, blocker = await kept_busy(database)
    waiting = [asyncio.create_task(database.write(studies.register, f"ring_{n}", "text")) for n in range(5)]
    broken = asyncio.create_task(database.write(fail_after_writing))
    waiting += [asyncio.create_task(database.write(studies.register, f"more_{n}", "text")) for n in range(5)]
    await asyncio.sleep(0.05)
    gate.set()
    assert await blocker
    with pytest.raises(LookupError, match="broken"):
        await broken
    assert len(await asyncio.gather(*waiting)) == 10
    assert await database.read(how_many) == 10


async def test_functions_that_wait_share_one_commit(database: Database, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("server.store.database.MAX_GROUP_S", math.inf)  # a busy machine takes long
    commits = counted_commits(database)
    gate, blocker = await kept_busy(database)
    waiting = [asyncio.create_task(database.write(studies.register, f"ring_{n}", "text")) for n in range(50)]
    await asyncio.sleep(0.05)
    gate.set()
    await asyncio.gather(blocker, *waiting)
    assert len(commits) == 2


async def test_a_group_that_takes_long_is_several_commits(database: Database, monkeypatch: pytest.MonkeyPatch) -> None:
    """So that 200 people who consent at once do not keep another server process waiting until it gives up."""
    monkeypatch.setattr("server.store.database.MAX_GROUP_S", -1.0)
    commits = counted_commits(database)
    gate, blocker = await kept_busy(database)
    waiting = [asyncio.create_task(database.write(studies.register, f"ring_{n}", "text")) for n in range(4)]
    broken = asyncio.create_task(database.write(fail_after_writing))
    last = asyncio.create_task(database.write(studies.register, "last", "text"))
    await asyncio.sleep(0.05)
    gate.set()
    with pytest.raises(LookupError):
        await broken
    assert await blocker
    stored = await asyncio.gather(*waiting, last)
    assert [one.key for one in stored] == ["ring_0", "ring_1", "ring_2", "ring_3", "last"]
    assert len(commits) == 7
    assert await database.read(how_many) == 5


async def test_failing_function_alone_leaves_nothing_behind(database: Database) -> None:
    with pytest.raises(LookupError):
        await database.write(fail_after_writing)
    assert await database.read(how_many) == 0


async def test_cancelled_write_that_has_not_begun_is_never_begun(database: Database) -> None:
    gate, blocker = await kept_busy(database)
    with pytest.raises(TimeoutError):
        await asyncio.wait_for(database.write(studies.register, "ring", "text"), 0.05)
    gate.set()
    await blocker
    await database.probe()
    assert await database.read(how_many) == 0


async def test_second_server_on_the_same_database_is_refused(database: Database) -> None:
    with pytest.raises(DatabaseInUse, match="another kitchenmind server"):
        Database(database.url.render_as_string())
    await database.probe()


async def test_database_can_be_opened_again_after_it_was_closed(url: str) -> None:
    for _ in range(2):
        with Database(url) as database:
            await database.probe()


def test_reading_connections_cannot_write(database: Database) -> None:
    with pytest.raises(Exception, match=r"read-?only"):
        database.read_now(studies.register, "ring", "text")


def test_read_only_database_refuses_to_write_and_takes_no_lock(database: Database) -> None:
    with Database(database.url.render_as_string(), read_only=True) as other:
        assert other.read_now(how_many) == 0
        with pytest.raises(ValueError, match="reading only"):
            other.write_now(studies.register, "ring", "text")


@pytest.mark.postgres
@pytest.mark.parametrize("encoding", ["SQL_ASCII", "LATIN1"])
def test_postgresql_that_cannot_hold_every_letter_is_refused_with_the_remedy(
    postgres: PostgresServer, encoding: str
) -> None:
    name = f"only_{encoding.lower()}"
    with psycopg.connect(postgres.url(), autocommit=True) as connection:
        connection.execute(f"CREATE DATABASE {name} ENCODING '{encoding}' LOCALE 'C' TEMPLATE template0")
    for open_it in (Database, migrate_shared):
        with pytest.raises(ValueError, match=f"as {encoding}, .* createdb --encoding UTF8 --template template0 {name}"):
            open_it(postgres.url(name))
    postgres.drop_database(name)


def test_folder_that_cannot_be_made_is_named(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("no folder")
    with pytest.raises(DatabaseDown, match="file"):
        Database(f"sqlite:///{tmp_path}/file/study.db")


async def test_closed_database_takes_no_more(database: Database) -> None:
    database.close()
    with pytest.raises(DatabaseDown, match="closed"):
        await database.write(studies.register, "ring", "text")


async def test_sqlite_locked_by_another_program_only_delays(tmp_path: Path) -> None:
    url = f"sqlite:///{tmp_path}/study.db"
    migrate(url)
    with Database(url) as database:
        intruder = create_engine(url, isolation_level="AUTOCOMMIT")
        with intruder.connect() as connection:
            connection.exec_driver_sql("BEGIN IMMEDIATE")
            waiting = asyncio.create_task(database.write(studies.register, "ring", "text"))
            await asyncio.sleep(0.3)
            assert not waiting.done()
            connection.exec_driver_sql("ROLLBACK")
        intruder.dispose()
        assert (await waiting).key == "ring"


async def test_a_lock_that_stays_is_reported_while_pages_can_still_wait_and_nothing_is_stored(url: str) -> None:
    hold = "BEGIN IMMEDIATE" if url.startswith("sqlite") else "BEGIN; LOCK TABLE studies"
    with Database(url) as database:
        intruder = create_engine(url, isolation_level="AUTOCOMMIT")
        with intruder.connect() as connection:
            connection.exec_driver_sql(hold)
            waiting = [asyncio.create_task(database.write(studies.register, "ring", "text"))]
            await asyncio.sleep(0.3)
            waiting.append(asyncio.create_task(database.write(studies.register, "matrix", "text")))
            async with asyncio.timeout(25):  # the lock stays: without a limit of its own the server would wait for ever
                refusals = await asyncio.gather(*waiting, return_exceptions=True)
            assert [type(refusal) for refusal in refusals] == [DatabaseDown, DatabaseDown]
            connection.exec_driver_sql("ROLLBACK")
        intruder.dispose()
        assert await database.read(studies.every) == []
        await database.write(studies.register, "ring", "text")


@pytest.mark.postgres
async def test_postgresql_that_was_stopped_counts_as_down_and_then_recovers() -> None:
    server = PostgresServer()
    try:
        url = server.url(server.new_database())
        migrate(url)
        with Database(url) as database:
            await database.write(studies.register, "before", "text")
            server.stop()
            with pytest.raises(DatabaseDown):
                await database.write(studies.register, "lost", "text")
            with pytest.raises(DatabaseDown):
                await database.read(how_many)
            server.start()
            await database.write(studies.register, "after", "text")
            assert [study.key for study in await database.read(studies.every)] == ["before", "after"]
    finally:
        server.remove()


def test_database_that_cannot_be_made_leaves_no_lock(tmp_path: Path) -> None:
    (tmp_path / "target").symlink_to(tmp_path / "missing" / "x.db")  # its folder is not there
    with pytest.raises(DatabaseDown):
        migrate(f"sqlite:///{tmp_path}/target")
    assert not (tmp_path / "target.lock").exists()
