"""A SQLite database that is moved, deleted or replaced while a server has it open."""

import errno
import shutil
from collections.abc import Callable
from pathlib import Path

import pytest
from sqlalchemy import Connection, func, select

from server.commands.databases import open_stored
from server.store import database_file, studies
from server.store.backup import copy_to
from server.store.database import Database, DatabaseDown
from server.store.migrate import migrate
from server.store.tables import studies as study_table


def how_many(connection: Connection) -> int:
    return connection.execute(select(func.count()).select_from(study_table)).scalar_one()


@pytest.fixture
def file(tmp_path: Path) -> Path:
    migrate(f"sqlite:///{tmp_path}/study.db")
    return tmp_path / "study.db"


def replaced(file: Path) -> None:
    shutil.copy(file, file.with_name("copy.db"))
    file.with_name("copy.db").replace(file)


@pytest.mark.parametrize(
    ("harm", "words"),
    [(Path.unlink, "moved or deleted"), (replaced, "replaced by another file")],
    ids=["deleted", "replaced"],
)
def test_nothing_counts_as_stored_in_a_file_that_is_gone(file: Path, harm: Callable[[Path], None], words: str) -> None:
    with Database(f"sqlite:///{file}") as database:
        database.write_now(studies.register, "ring", "text")
        harm(file)
        for _ in range(2):
            with pytest.raises(DatabaseDown, match=words):
                database.write_now(studies.register, "lost", "text")


def test_a_database_that_is_put_back_is_written_again_and_has_everything(file: Path) -> None:
    elsewhere = file.with_name("elsewhere.db")
    with Database(f"sqlite:///{file}") as database:
        database.write_now(studies.register, "ring", "text")
        file.rename(elsewhere)
        with pytest.raises(DatabaseDown):
            database.write_now(studies.register, "late", "text")
        assert not file.exists(), "no empty database takes its place"
        elsewhere.rename(file)
        database.write_now(studies.register, "after", "text")
    with Database(f"sqlite:///{file}", read_only=True) as database:
        assert database.read_now(how_many) == 2


def test_a_log_without_its_database_is_not_dropped(file: Path) -> None:
    elsewhere = file.with_name("elsewhere.db")
    with Database(f"sqlite:///{file}") as database:
        database.write_now(studies.register, "ring", "text")
        file.rename(elsewhere)
    log = Path(f"{file}-wal").read_bytes()
    for open_it in (Database, migrate):
        with pytest.raises(DatabaseDown, match=r"study\.db is missing, but its log study\.db-wal is there"):
            open_it(f"sqlite:///{file}")
    assert (file.exists(), Path(f"{file}-wal").read_bytes()) == (False, log)
    elsewhere.rename(file)
    with Database(f"sqlite:///{file}") as database:
        assert database.read_now(how_many) == 1


def test_a_restored_backup_is_not_mixed_with_the_log_of_what_it_replaced(file: Path) -> None:
    url, log = f"sqlite:///{file}", Path(f"{file}-wal")
    with Database(url) as database:
        database.write_now(studies.register, "ring", "text")
        copy_to(database.url, file.with_name("copy.db"))
        database.write_now(studies.register, "later", "text")
        crashed = log.read_bytes()
    shutil.copy(file.with_name("copy.db"), file)
    log.write_bytes(crashed)
    for open_it in (Database, migrate, open_stored):
        with pytest.raises((DatabaseDown, ValueError), match=r"study\.db is a backup, but the log study\.db-wal of"):
            open_it(url)
    assert log.read_bytes() == crashed
    log.unlink()
    with Database(url) as database:
        assert database.read_now(how_many) == 1
        database.write_now(studies.register, "after", "text")
        crashed = log.read_bytes()
        both = file.read_bytes()
    file.write_bytes(both)
    log.write_bytes(crashed)
    with Database(url) as database:
        assert database.read_now(how_many) == 2, "what crashes after a restore has a log of its own"


def test_a_disk_without_room_for_the_lock_is_reported_without_a_traceback(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def full(*_: object) -> int:
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr(database_file.os, "write", full)
    with pytest.raises(DatabaseDown, match=r"cannot write .*study\.db\.lock: No space left on device"):
        Database(f"sqlite:///{tmp_path}/study.db")
