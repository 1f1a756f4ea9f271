"""Fresh databases of both kinds for every test."""

import shutil
from collections.abc import Iterator
from pathlib import Path

import pytest

from server.store.database import Database
from tests.support.databases import with_tables
from tests.support.postgres_pool import PostgresPool
from tests.support.postgres_server import PostgresServer
from tests.support.study_data import fill

KINDS = ["sqlite", pytest.param("postgresql", marks=pytest.mark.postgres)]


@pytest.fixture(scope="session")
def filled_sqlite(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A database with a played study, to be copied."""
    file = tmp_path_factory.mktemp("filled") / "study.db"
    with Database(with_tables(file)) as database:
        database.write_now(fill)
    return file


@pytest.fixture(scope="session")
def filled_postgres(postgres: PostgresServer, postgres_template: str) -> str:
    """The same in PostgreSQL."""
    name = postgres.new_database(postgres_template)
    with Database(postgres.url(name)) as database:
        database.write_now(fill)
    return name


@pytest.fixture(scope="session")
def postgres_pool(postgres: PostgresServer, postgres_template: str) -> PostgresPool:
    """Databases with the tables."""
    return PostgresPool(postgres, postgres_template)


@pytest.fixture(scope="session")
def filled_postgres_pool(postgres: PostgresServer, filled_postgres: str) -> PostgresPool:
    """Databases with a played study."""
    return PostgresPool(postgres, filled_postgres)


@pytest.fixture(params=KINDS)
def url(request: pytest.FixtureRequest, tmp_path: Path) -> Iterator[str]:
    """The address of a fresh database with the tables; with a played study where the test asks for `filled` too."""
    is_filled = "filled" in request.fixturenames
    if request.param == "sqlite":
        file = tmp_path / "study.db"
        if is_filled:
            shutil.copyfile(request.getfixturevalue("filled_sqlite"), file)
        yield f"sqlite:///{file}" if is_filled else with_tables(file)
        return
    pool: PostgresPool = request.getfixturevalue("filled_postgres_pool" if is_filled else "postgres_pool")
    with pool.one() as address:
        yield address


@pytest.fixture
def filled(database: Database) -> Database:
    """With a played study; see `url`."""
    return database


@pytest.fixture
def database(url: str) -> Iterator[Database]:
    with Database(url) as opened:
        yield opened
