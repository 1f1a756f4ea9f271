"""Files of a database are readable for its owner only."""

import os
import stat
from collections.abc import Iterator
from pathlib import Path

import pytest
from sqlalchemy import Connection, func, select

from server.store import studies
from server.store.database import Database
from server.store.migrate import migrate
from server.store.tables import studies as study_table


def how_many(connection: Connection) -> int:
    return connection.execute(select(func.count()).select_from(study_table)).scalar_one()


@pytest.fixture
def loose() -> Iterator[None]:
    before = os.umask(0)
    yield
    os.umask(before)


def rights(path: Path) -> int:
    return stat.S_IMODE(path.stat().st_mode)


@pytest.mark.usefixtures("loose")
def test_files_of_a_database_are_for_its_owner_only(tmp_path: Path) -> None:
    url = f"sqlite:///{tmp_path}/new/deeper/study.db"
    migrate(url)
    with Database(url) as database:
        database.write_now(studies.register, "ring", "text")
        database.read_now(how_many)
        files = {path.name: rights(path) for path in (tmp_path / "new" / "deeper").iterdir()}
        assert files == dict.fromkeys(("study.db", "study.db-wal", "study.db-shm", "study.db.lock"), 0o600)
    assert [rights(tmp_path / "new"), rights(tmp_path / "new" / "deeper")] == [0o700, 0o700]


@pytest.mark.usefixtures("loose")
def test_files_that_everybody_could_read_are_taken_back_and_those_of_a_group_stay(tmp_path: Path) -> None:
    url = f"sqlite:///{tmp_path}/study.db"
    migrate(url)
    (tmp_path / "study.db").chmod(0o644)
    with Database(url):
        assert rights(tmp_path / "study.db") == 0o600
    (tmp_path / "study.db").chmod(0o660)
    with Database(url):
        assert rights(tmp_path / "study.db") == 0o660
