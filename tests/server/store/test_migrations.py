"""A database of every earlier version opens, is brought up to date and keeps its data, on SQLite and PostgreSQL."""

from collections.abc import Iterator
from pathlib import Path

import pytest
from alembic import command
from alembic.config import Config
from alembic.script import ScriptDirectory
from msgspec import structs
from sqlalchemy import Connection, Table, inspect

from server.store import engines, episodes, fences, participants, studies, tables, ticks
from server.store.database import Database
from server.store.engines import DatabaseInUse
from server.store.migrate import MIGRATIONS, known_revisions, migrate, migrate_shared, newest_revision, revision_of
from tests.support.postgres_server import PostgresServer
from tests.support.study_data import SPEC, START, played

KINDS = ["sqlite", pytest.param("postgresql", marks=pytest.mark.postgres)]
PERSON = "a person"
EARLIER = [revision for revision in known_revisions() if revision != newest_revision()]
# From the oldest, PostgreSQL goes through every migration with data too; from all, SQLite does.
UPGRADES = [("sqlite", revision) for revision in EARLIER] + [
    pytest.param("postgresql", revision, marks=pytest.mark.postgres) for revision in (EARLIER[0], EARLIER[-1])
]


@pytest.fixture(params=KINDS)
def empty(request: pytest.FixtureRequest, tmp_path: Path) -> Iterator[str]:
    """The address of a database without tables."""
    if request.param == "sqlite":
        yield f"sqlite:///{tmp_path}/study.db"
        return
    server: PostgresServer = request.getfixturevalue("postgres")
    name = server.new_database()
    yield server.url(name)
    server.drop_database(name)


def make_as_of(url: str, revision: str) -> None:
    """The tables as that version had them."""
    config = Config()
    config.set_main_option("script_location", str(MIGRATIONS))
    writer = engines.WriteConnection(engines.normal_url(url))
    with writer.transaction() as connection:
        config.attributes["connection"] = connection
        command.upgrade(config, revision)
    writer.close()


def insert(connection: Connection, table: Table, row: dict[str, object]) -> int:
    """Insert a row into a table that may lack the columns of this version; return its number."""
    query = table.insert().values(row).returning(next(iter(table.primary_key)))
    return connection.execute(query).scalar_one()


def _columns(connection: Connection, table: str) -> set[str]:
    """The columns as that version had them."""
    return {column["name"] for column in inspect(connection).get_columns(table)}


def fill(connection: Connection) -> str:
    study = {"key": "ring", "version": 1, "sha256": "0" * 64, "source": "text", "created_at": START, "started": 7}
    study_id = insert(connection, tables.studies, study)
    person = {"id": PERSON, "study_id": study_id, "number": 7, "condition": "tom", "seed": 1, "simulated": False}
    if "allocation_number" in _columns(connection, "participants"):
        person["allocation_number"] = 7
    insert(connection, tables.participants, person | {"started_at": START, "last_seen_at": START, "token_hash": "0"})
    episode = episodes.create(connection, episodes.NewEpisode(SPEC, "episode-01", study_id=study_id))
    present = _columns(connection, "ticks")
    for record in played(episode):
        row = dict(zip(tables.ticks.c.keys(), ticks.row_of(record), strict=True))
        connection.execute(tables.ticks.insert().values({name: row[name] for name in row if name in present}))
    connection.execute(tables.episodes.update().values(status="running"))
    return episode


@pytest.mark.parametrize(("empty", "revision"), UPGRADES, indirect=["empty"])
def test_a_database_of_an_earlier_version_keeps_its_data(empty: str, revision: str) -> None:
    make_as_of(empty, revision)
    with Database(empty) as database:
        assert database.read_now(revision_of) == revision
        episode = database.write_now(fill)
    migrate(empty)
    with Database(empty) as database:
        assert database.read_now(revision_of) == newest_revision()
        told = played(episode)
        if revision < "0008":
            told = [structs.replace(record, made_unix_ms=None) for record in told]
        if revision < "0014":
            told = [structs.replace(record, intentions=(), displayed_intention=None) for record in told]
        assert database.read_now(ticks.of_episode, episode) == told
        loaded = database.read_now(episodes.load, episode)
        assert loaded is not None
        assert (loaded.status, loaded.last_hash) == ("running", played(episode)[-1].state_hash)
        assert database.read_now(fences.current, episode) == 0
        participant = database.read_now(participants.get, PERSON)
        assert participant is not None
        assert participant.allocation_number == 7, "the order of the episodes stays"
        assert [study.key for study in database.read_now(studies.every, "ring")] == ["ring"]


def test_the_revisions_are_those_that_alembic_finds() -> None:
    found = ScriptDirectory(str(MIGRATIONS)).walk_revisions()
    assert known_revisions() == tuple(script.revision for script in found)


def test_tables_of_this_version_are_left_alone_without_alembic(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    url = f"sqlite:///{tmp_path}/study.db"
    migrate(url)
    monkeypatch.setattr(command, "upgrade", lambda *_: pytest.fail("there is nothing to bring up to date"))
    migrate(url)


@pytest.mark.postgres
def test_processes_that_join_others_leave_tables_of_their_version_alone(postgres: PostgresServer) -> None:
    name = postgres.new_database()
    url = postgres.url(name)
    migrate_shared(url)
    with Database(url, shared=True):
        migrate_shared(url)
        with pytest.raises(DatabaseInUse):
            migrate(url)
    postgres.drop_database(name)
