"""A separate PostgreSQL server in a temporary folder, on a Unix socket only; started by the tests, gone with them."""

import os
import pwd
import secrets
import shutil
import signal
import subprocess
import tempfile
from contextlib import suppress
from pathlib import Path

import psycopg

_SETTINGS = ("listen_addresses=", "shared_buffers=32MB", "max_connections=60")
_QUICK = ("fsync=off", "full_page_writes=off")  # survives a killed process, not a power cut


def programs() -> Path:
    """The folder of `initdb` and `postgres`. Raises FileNotFoundError with the remedy."""
    found = shutil.which("initdb")
    folders = [Path(found).resolve().parent] if found else sorted(Path("/usr/lib/postgresql").glob("*/bin"))
    if not folders or not (folders[-1] / "postgres").exists():
        raise FileNotFoundError("no PostgreSQL programs found. Install them, e.g. apt-get install postgresql.")
    return folders[-1]


class PostgresServer:
    """`url(name)` is the address of a database; `stop`, `freeze`, `thaw` and `start` make it fail and come back."""

    def __init__(self, durable: bool = False) -> None:
        self._settings = _SETTINGS if durable else _SETTINGS + _QUICK
        self.folder = Path(tempfile.mkdtemp(prefix="kitchenmind-postgres-"))
        self._programs = programs()
        self._as: dict[str, object] = {}
        if os.geteuid() == 0:  # PostgreSQL refuses to run as root
            names = {entry.pw_name: entry for entry in pwd.getpwall()}
            user = names.get("postgres") or names["nobody"]
            os.chown(self.folder, user.pw_uid, user.pw_gid)
            self._as = {"user": user.pw_uid, "group": user.pw_gid, "extra_groups": []}
        self._run("initdb", "-D", "data", "-U", "kitchenmind", "-A", "trust", "-N", "-E", "UTF8", "--no-locale")
        self._process: subprocess.Popen[bytes] | None = None
        self.start()

    def url(self, name: str = "postgres") -> str:
        return f"postgresql://kitchenmind@/{name}?host={self.folder}"

    def new_database(self, template: str = "template1") -> str:
        """The name of a fresh database, a copy of `template`."""
        name = f"study_{secrets.token_hex(6)}"
        with psycopg.connect(self.url(), autocommit=True) as connection:
            connection.execute(f"CREATE DATABASE {name} TEMPLATE {template}")
        return name

    def drop_database(self, name: str) -> None:
        with psycopg.connect(self.url(), autocommit=True) as connection:
            connection.execute(f"DROP DATABASE {name} WITH (FORCE)")

    def start(self) -> None:
        settings = [word for setting in self._settings for word in ("-c", setting)]
        dies_with_us = [shutil.which("setpriv"), "--pdeathsig", "QUIT"] if shutil.which("setpriv") else []
        command = [*dies_with_us, self._programs / "postgres", "-D", "data", "-k", self.folder, *settings]
        log = (self.folder / "log").open("ab")
        self._process = subprocess.Popen(command, cwd=self.folder, stdout=log, stderr=log, **self._as)  # type: ignore[call-overload]
        log.close()
        self._run("pg_isready", "-q", "-h", str(self.folder), "-U", "kitchenmind", tries=200)

    def stop(self) -> None:
        """At once, as if the power had gone."""
        assert self._process is not None
        self._process.send_signal(signal.SIGQUIT)
        self._process.wait(30)
        self._process = None

    def freeze(self) -> None:
        """Suspend every process of the server: it does not answer, and connections stay open."""
        assert self._process is not None
        self._process.send_signal(signal.SIGSTOP)  # first: from here on its children stay the same
        self._signal_children(signal.SIGSTOP)

    def thaw(self) -> None:
        assert self._process is not None
        self._signal_children(signal.SIGCONT)
        self._process.send_signal(signal.SIGCONT)

    def _signal_children(self, number: signal.Signals) -> None:
        """From the whole list of processes: the kernel's own list of children may leave some out."""
        assert self._process is not None
        for status in Path("/proc").glob("[0-9]*/stat"):
            with suppress(OSError):  # it has ended
                parent = status.read_text().rpartition(")")[2].split()[1]
                if int(parent) == self._process.pid:
                    os.kill(int(status.parent.name), number)

    def remove(self) -> None:
        if self._process is not None:
            self.stop()
        shutil.rmtree(self.folder, ignore_errors=True)

    def _run(self, program: str, *arguments: str, tries: int = 1) -> None:
        command = [str(self._programs / program), *arguments]
        for left in reversed(range(tries)):
            done = subprocess.run(command, cwd=self.folder, capture_output=True, text=True, **self._as)  # type: ignore[call-overload]
            if done.returncode == 0:
                return
            if left == 0:
                raise RuntimeError(f"{program} failed: {done.stdout}{done.stderr}")
            subprocess.run(["sleep", "0.05"], check=True)
