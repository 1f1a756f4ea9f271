"""The secret that the server makes in local mode: whole or not there, and one for all processes."""

import errno
import stat
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from threading import Barrier

import pytest

from server import kept_secret
from server.settings import Settings


def key_in(folder: Path) -> bytes:
    return Settings(data=folder, secret=None).signing_key()


@pytest.fixture(autouse=True)
def no_secret(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("KITCHENMIND_SECRET", raising=False)


def test_the_secret_is_made_once_for_its_owner_only(tmp_path: Path) -> None:
    made = key_in(tmp_path / "new")
    file = tmp_path / "new" / "secret"
    assert (len(made) >= 40, key_in(tmp_path / "new"), file.read_bytes()) == (True, made, made)
    assert stat.S_IMODE(file.stat().st_mode) == 0o600


def test_a_secret_that_its_owner_may_only_read_is_used(tmp_path: Path) -> None:
    (tmp_path / "secret").write_text("kept for years")
    (tmp_path / "secret").chmod(0o400)
    assert key_in(tmp_path) == b"kept for years"


def test_forms_are_never_signed_with_an_empty_secret(tmp_path: Path) -> None:
    (tmp_path / "secret").touch(0o600)  # what a full disk left behind
    made = key_in(tmp_path)
    assert (len(made) >= 40, key_in(tmp_path)) == (True, made)


def test_a_secret_that_cannot_be_written_is_refused_with_the_reason(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def full(*_: object) -> None:
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr(kept_secret.os, "fsync", full)
    with pytest.raises(ValueError, match=r"cannot keep the secret in .*secret \(No space left on device\)"):
        key_in(tmp_path)
    monkeypatch.undo()
    assert len(key_in(tmp_path)) >= 40


def test_processes_that_start_at_once_have_the_same_secret(tmp_path: Path) -> None:
    together = Barrier(8)

    def start(folder: Path) -> bytes:
        together.wait()
        return key_in(folder)

    with ThreadPoolExecutor(8) as threads:
        for number in range(40):
            keys = set(threads.map(start, [tmp_path / str(number)] * 8))
            assert len(keys) == 1, number
            assert b"" not in keys
