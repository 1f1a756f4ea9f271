"""The page on backups, to the letter: its commands in their order, with our PostgreSQL in place of its."""

import os
import re
import subprocess
import sys
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import pytest

from server.store import participants, studies
from server.store.database import Database
from server.store.migrate import migrate
from tests.support.postgres_server import PostgresServer, programs
from tests.support.study_data import fill
from tests.test_guides import blocks

ROOT = Path(__file__).parent.parent
PAGE = ROOT / "docs" / "guides" / "backup.md"
# In every run, tests/server/store/test_backup.py does the same in one process.
pytestmark = [pytest.mark.postgres, pytest.mark.slow]


@dataclass(frozen=True)
class Lab:
    """A folder and a PostgreSQL, as on the page."""

    folder: Path
    postgres: PostgresServer

    def does(self, command: str) -> None:
        own = f"{sys.executable} {ROOT / 'kitchenmind'}"
        ours = command.replace(".venv/bin/kitchenmind", own)
        ours = re.sub(r"postgresql://kitchenmind@localhost/(\w+)", lambda name: f"'{self.postgres.url(name[1])}'", ours)
        done = subprocess.run(
            ours,
            shell=True,
            cwd=self.folder,
            env={**os.environ, "PATH": f"{programs()}:{os.environ['PATH']}"},
            capture_output=True,
            text=True,
            timeout=120,
        )
        assert done.returncode == 0, f"{command}\n{done.stdout}{done.stderr}"


@pytest.fixture
def lab(tmp_path: Path) -> Iterator[Lab]:
    """With a played study in SQLite and the same one in PostgreSQL."""
    postgres = PostgresServer()
    (tmp_path / "var").mkdir()
    made = Lab(tmp_path, postgres)
    made.does(f"createdb -h {postgres.folder} -U kitchenmind kitchenmind")
    for url in (f"sqlite:///{tmp_path}/var/kitchenmind.sqlite3", postgres.url("kitchenmind")):
        migrate(url)
        with Database(url) as database:
            database.write_now(fill)
    yield made
    postgres.remove()


def test_every_command_of_the_page_on_backups_does_what_it_says(lab: Lab) -> None:
    copy, dump, check, move, delete = (text for _, text in blocks(PAGE))
    for block in (copy, dump, check):
        lab.does(block)
    tools = f"-h {lab.postgres.folder} -U kitchenmind"
    lab.does(f"createdb {tools} restored")
    lab.does("pg_restore --dbname=postgresql://kitchenmind@localhost/restored backup-2026-03-01.dump")
    lab.does(".venv/bin/kitchenmind verify --database postgresql://kitchenmind@localhost/restored")
    lab.does(f"dropdb {tools} kitchenmind")
    lab.does(f"createdb {tools} kitchenmind")
    for line in move.splitlines():
        lab.does(line)
    with Database(lab.postgres.url("kitchenmind"), read_only=True) as moved:
        assert [study.key for study in moved.read_now(studies.every)]
        assert moved.read_now(participants.of_study, 1)
    lab.does(delete.replace("my_study", "ring").rstrip() + " --yes --database sqlite:///var/kitchenmind.sqlite3")
    with Database(f"sqlite:///{lab.folder}/var/kitchenmind.sqlite3", read_only=True) as emptied:
        assert emptied.read_now(participants.of_study, 1) == []
