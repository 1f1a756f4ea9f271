"""What a killed backup or export leaves behind has everybody's data: the next one in that folder removes it."""

import errno
import fcntl
import subprocess
import sys
from pathlib import Path

import pytest

import kitchenmind
from server.store.database import Database
from server.store.migrate import migrate
from server.store.work_folders import WorkFolder, remove_abandoned
from tests.support.study_data import fill

_KILLED = """
import os, signal, sqlite3, sys
import kitchenmind
from server.export import manifest
from server.store import backup
def killed(*_):
    os.kill(os.getpid(), signal.SIGKILL)
backup.os.fsync = manifest.write_about = killed
kitchenmind.main(sys.argv[1:])
"""


@pytest.mark.parametrize("command", [("backup", "--to"), ("export", "--format", "csv", "--out")], ids=" ".join)
def test_what_a_killed_command_left_goes_with_the_next_one(tmp_path: Path, command: tuple[str, ...]) -> None:
    database, folder = f"sqlite:///{tmp_path}/study.db", tmp_path / "copies"
    folder.mkdir()
    (folder / "other").mkdir()
    migrate(database)
    with Database(database) as stored:
        stored.write_now(fill)
    words = [*command, str(folder / "monday"), "--database", database]
    assert subprocess.run([sys.executable, "-c", _KILLED, *words]).returncode == -9
    assert len(list(folder.iterdir())) == 2, "the unfinished copy is there"
    assert kitchenmind.main([*command, str(folder / "tuesday"), "--database", database]) == 0
    assert sorted(path.name for path in folder.iterdir()) == ["other", "tuesday"]


def test_a_file_system_without_locks_can_be_copied_to(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def unsupported(*_: object) -> None:
        raise OSError(errno.ENOTSUP, "Operation not supported")

    monkeypatch.setattr(fcntl, "flock", unsupported)
    with WorkFolder("copy-", tmp_path) as folder:
        remove_abandoned("copy-", tmp_path)
        assert folder.path.exists()
    assert list(tmp_path.iterdir()) == []
