"""`kitchenmind admin` at a terminal: the server continues while somebody types a password."""

import os
import pty
import re
import select
import sqlite3
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from datetime import UTC, datetime
from pathlib import Path

import pytest

import kitchenmind
from server.settings import ROOT
from server.store import admins, audit
from server.store.database import Database
from server.store.migrate import migrate


class PseudoTerminal:
    """A command that runs in a pseudo-terminal."""

    def __init__(self, *words: str) -> None:
        self.said = ""
        self._line, theirs = pty.openpty()
        command = [sys.executable, str(ROOT / "kitchenmind"), *words]
        self._running = subprocess.Popen(command, stdin=theirs, stdout=theirs, stderr=theirs, start_new_session=True)
        os.close(theirs)

    def until(self, words: str, within_s: float = 120) -> None:
        deadline = time.monotonic() + within_s
        while words not in self.said:
            ready, _, _ = select.select([self._line], [], [], max(0.0, deadline - time.monotonic()))
            assert ready, self.said
            self.said += os.read(self._line, 4096).decode()

    def type(self, words: str) -> None:
        os.write(self._line, words.encode())

    def end(self) -> int:
        """The exit status, once it has said everything."""
        while True:
            try:
                more = os.read(self._line, 4096)
            except OSError:  # what Linux says at the end
                break
            if not more:
                break
            self.said += more.decode()
        os.close(self._line)
        return self._running.wait(60)


@pytest.fixture
def url(tmp_path: Path) -> str:
    address = f"sqlite:///{tmp_path}/study.db"
    migrate(address)
    return address


@contextmanager
def asked(url: str, *words: str) -> Iterator[PseudoTerminal]:
    terminal = PseudoTerminal("admin", "--database", url, *words)
    terminal.until("Password")
    yield terminal


@pytest.mark.parametrize("verb", ["create", "reset"])
def test_nobody_waits_while_a_password_is_typed(url: str, verb: str) -> None:
    with Database(url) as database:
        database.write_now(admins.create, "mara", "a hash", "act")
    name = "ada" if verb == "create" else "mara"
    with asked(url, verb, name) as terminal:
        other = sqlite3.connect(url.removeprefix("sqlite:///"), timeout=0)
        other.execute("BEGIN IMMEDIATE")  # raises OperationalError while somebody else may write
        other.rollback()
        other.close()
        terminal.type("a quite long password\n")
        terminal.until("Again")
        terminal.type("a quite long password\n")
        assert terminal.end() == 0, terminal.said
    with Database(url, read_only=True) as database:
        stored = database.read_now(admins.password_hash_of, name)
        assert stored is not None
        assert stored.startswith("$argon2id$")
        assert database.read_now(audit.entries)[-1].detail == {"name": name}


def test_leaving_the_password_prompt_changes_nothing(url: str) -> None:
    with asked(url, "create", "ada") as terminal:
        terminal.type("\x04")
        assert terminal.end() == 2
    assert "nothing was changed" in terminal.said
    assert "Traceback" not in terminal.said


def test_names_are_looked_up_before_anybody_is_asked(url: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert kitchenmind.main(["admin", "--database", url, "create", "ada"]) == 0
    assert re.search(r"password: \S{20}", capsys.readouterr().out)
    assert kitchenmind.main(["admin", "--database", url, "create", "ada"]) == 2
    assert "kitchenmind admin reset ada" in capsys.readouterr().err
    for verb in ("reset", "remove"):
        assert kitchenmind.main(["admin", "--database", url, verb, "nobody"]) == 2
        assert "kitchenmind admin list" in capsys.readouterr().err
    assert kitchenmind.main(["admin", "--database", url, "list"]) == 0
    assert capsys.readouterr().out.split()[:2] == ["ada", "own"]
    assert kitchenmind.main(["admin", "--database", url, "remove", "ada"]) == 0
    with Database(url, read_only=True) as database:
        assert database.read_now(admins.every) == []
        assert [entry.action for entry in database.read_now(audit.entries)] == ["admin create", "admin remove"]
        assert database.read_now(audit.first_forged) is None


def test_an_account_gets_another_role_and_signs_in_again(url: str, capsys: pytest.CaptureFixture[str]) -> None:
    token, now = "t" * 64, datetime.now(UTC)
    with Database(url) as database:
        database.write_now(admins.create, "mara", "a hash", "act")
        database.write_now(admins.open_session, "mara", token, now)
    assert kitchenmind.main(["admin", "--database", url, "role", "mara", "watch"]) == 0
    assert capsys.readouterr().out == "mara: has the role watch, and signs in again\n"
    with Database(url, read_only=True) as database:
        assert [(one.name, one.role) for one in database.read_now(admins.every)] == [("mara", "watch")]
        assert database.read_now(admins.session, token, now) is None, "it may show what a watcher may not see"
        entry = database.read_now(audit.entries)[-1]
        assert (entry.action, entry.detail) == ("admin role", {"name": "mara", "role": "watch"})


def test_a_role_that_is_none_and_an_unknown_account_are_refused(url: str, capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit):
        kitchenmind.main(["admin", "--database", url, "role", "mara", "king"])
    assert "watch" in capsys.readouterr().err
    assert kitchenmind.main(["admin", "--database", url, "role", "nobody", "own"]) == 2
    assert "there is no account 'nobody'" in capsys.readouterr().err
