"""Folders with people's data go with their work, also if the server is killed."""

import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import pytest

from server.monitoring.temporary_folders import TemporaryFolder, remove_abandoned

_SERVER = """
import time
from server.monitoring.temporary_folders import TemporaryFolder
folder = TemporaryFolder("export")
(folder.path / "answers.csv").write_text("what somebody wrote")
print(folder.path, flush=True)
time.sleep(600)
"""
_WORKER = """
import sys, time
from pathlib import Path
from server.monitoring.temporary_folders import end_with_the_server
end_with_the_server(Path(sys.argv[1]))
print("works", flush=True)
time.sleep(600)
"""
# Starts the worker, as a server does.
_STARTER = "import subprocess, sys; subprocess.run([sys.executable, '-c', *sys.argv[1:]])"
PATIENCE_S = 20


@pytest.fixture(autouse=True)
def temporary(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv("TMPDIR", str(tmp_path))
    monkeypatch.setattr(tempfile, "tempdir", None)
    return tmp_path


def test_a_folder_is_for_its_owner_only_and_goes_with_its_work(temporary: Path) -> None:
    with TemporaryFolder("report") as folder:
        assert (folder.path.parent, folder.path.stat().st_mode & 0o777) == (temporary, 0o700)
        (folder.path / "inner").mkdir()
    folder.remove()
    assert not folder.path.exists()


def test_the_next_server_removes_what_a_killed_one_left_and_nothing_else(temporary: Path) -> None:
    killed = subprocess.Popen([sys.executable, "-c", _SERVER], stdout=subprocess.PIPE, text=True)
    assert killed.stdout is not None
    left = Path(killed.stdout.readline().strip())
    elsewhere = temporary / "elsewhere"
    (elsewhere / "kept").mkdir(parents=True)
    (temporary / "kitchenmind-export-link").symlink_to(elsewhere)
    with TemporaryFolder("export") as mine:
        remove_abandoned()
        assert left.exists(), "its server lives"
        killed.kill()
        killed.communicate()
        remove_abandoned()
        assert (left.exists(), mine.path.exists(), (elsewhere / "kept").exists()) == (False, True, True)


def test_work_ends_with_its_server_and_leaves_nothing_behind(temporary: Path) -> None:
    folder = temporary / "kitchenmind-export-1"
    (folder / "small").mkdir(parents=True)
    words = [sys.executable, "-c", _STARTER, _WORKER, str(folder)]
    server = subprocess.Popen(words, stdout=subprocess.PIPE, text=True, env=os.environ)
    assert server.stdout is not None
    assert server.stdout.readline() == "works\n"
    server.kill()
    server.wait()
    until = time.monotonic() + PATIENCE_S
    while folder.exists():
        assert time.monotonic() < until
        time.sleep(0.05)
    assert server.stdout.read() == "", "the worker has ended: it has closed its output"
    server.stdout.close()
