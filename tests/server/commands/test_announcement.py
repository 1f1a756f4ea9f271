"""What `kitchenmind serve` prints when it starts: a command that can be typed as it is."""

import errno
import io
import socket
import sys
from pathlib import Path

import pytest

from server.commands import serve
from server.settings import Settings


@pytest.mark.parametrize(
    ("on_path", "here", "called"),
    [(False, True, ".venv/bin/kitchenmind"), (True, True, "kitchenmind"), (False, False, "{bin}/kitchenmind")],
)
def test_the_printed_command_is_found_from_where_the_server_runs(
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
    on_path: bool,
    here: bool,
    called: str,
) -> None:
    folder = tmp_path / "checkout" / ".venv" / "bin"
    folder.mkdir(parents=True)
    (folder / "kitchenmind").touch(mode=0o755)
    monkeypatch.setattr(sys, "executable", str(folder / "python"))
    monkeypatch.setenv("PATH", str(folder if on_path else tmp_path))
    (tmp_path / "elsewhere").mkdir()
    monkeypatch.chdir(tmp_path / ("checkout" if here else "elsewhere"))
    with socket.create_server(("127.0.0.1", 0)) as listening:
        serve._announce(Settings(_env_file=None), listening)
    assert f"`{called.format(bin=folder)} admin create NAME --role own" in capsys.readouterr().out


class FullDisk(io.StringIO):
    """A log whose disk is full."""

    def flush(self) -> None:
        raise OSError(errno.ENOSPC, "No space left on device")


def test_a_server_whose_log_cannot_be_written_starts_all_the_same(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sys, "stdout", FullDisk())
    with socket.create_server(("127.0.0.1", 0)) as listening:
        serve._announce(Settings(_env_file=None), listening)
