"""Fresh databases of both kinds for every test."""

from collections.abc import Iterator
from pathlib import Path

import pytest

from server.store.database import Database
from server.store.migrate import migrate
from tests.support.postgres_server import PostgresServer

KINDS = ["sqlite", pytest.param("postgresql", marks=pytest.mark.postgres)]


@pytest.fixture(scope="session")
def postgres() -> Iterator[PostgresServer]:
    server = PostgresServer()
    yield server
    server.remove()


@pytest.fixture(scope="session")
def postgres_template(postgres: PostgresServer) -> str:
    """The name of a database that has the tables: copied in a moment, where migrating would take longer."""
    name = postgres.new_database()
    migrate(postgres.url(name))
    return name


@pytest.fixture(params=KINDS)
def url(request: pytest.FixtureRequest, tmp_path: Path) -> Iterator[str]:
    """The address of a fresh database with the tables."""
    if request.param == "sqlite":
        address = f"sqlite:///{tmp_path}/study.db"
        migrate(address)
        yield address
        return
    server: PostgresServer = request.getfixturevalue("postgres")
    name = server.new_database(request.getfixturevalue("postgres_template"))
    yield server.url(name)
    server.drop_database(name)


@pytest.fixture
def database(url: str) -> Iterator[Database]:
    with Database(url) as opened:
        yield opened
