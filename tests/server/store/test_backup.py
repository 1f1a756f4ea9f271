import os
import re
import shutil
import stat
import subprocess
import threading
from pathlib import Path

import psycopg
import pytest
from sqlalchemy import func, select

import kitchenmind
from server.settings import ROOT
from server.store import engines, episodes, studies, ticks
from server.store.database import Database
from server.store.migrate import DatabaseTooNew, migrate
from server.store.tables import participants, study_reports
from tests.server.store.test_migrations import EARLIER, make_as_of
from tests.server.store.test_migrations import fill as fill_old
from tests.support.postgres_server import PostgresServer, programs
from tests.support.study_data import SPEC, fill, played


@pytest.fixture
def database(tmp_path: Path) -> Database:
    url = f"sqlite:///{tmp_path}/study.db"
    migrate(url)
    return Database(url)


def backup(database: Database, path: Path) -> int:
    return kitchenmind.main(["backup", "--database", database.url.render_as_string(), "--to", str(path)])


def test_backup_is_for_its_owner_only(database: Database, tmp_path: Path) -> None:
    before = os.umask(0)
    try:
        assert backup(database, tmp_path / "copy.db") == 0
    finally:
        os.umask(before)
        database.close()
    assert stat.S_IMODE((tmp_path / "copy.db").stat().st_mode) == 0o600


def test_backup_taken_while_the_server_writes_is_one_good_state(database: Database, tmp_path: Path) -> None:
    stop = threading.Event()

    def write() -> None:
        while not stop.is_set():
            episode = database.write_now(episodes.create, episodes.NewEpisode(SPEC, "episode-01"))
            database.write_now(ticks.insert, played(episode, 10))

    with database:
        database.write_now(fill)
        writing = threading.Thread(target=write)
        writing.start()
        try:
            for number in range(3):
                copy = tmp_path / "copies" / f"{number}.db"
                copy.parent.mkdir(exist_ok=True)
                assert backup(database, copy) == 0
                assert kitchenmind.main(["verify", "--database", f"sqlite:///{copy}"]) == 0
        finally:
            stop.set()
            writing.join()


def test_restored_backup_is_served_as_before(database: Database, tmp_path: Path) -> None:
    with database:
        study = database.write_now(fill)
        assert backup(database, tmp_path / "copy.db") == 0
        before = database.read_now(studies.every)
    (tmp_path / "restored").mkdir()
    shutil.copy(tmp_path / "copy.db", tmp_path / "restored" / "study.db")
    url = f"sqlite:///{tmp_path}/restored/study.db"
    migrate(url)
    with Database(url) as restored:
        assert restored.read_now(studies.every) == before
        restored.write_now(fill, key="another")
        assert [found.id for found in restored.read_now(studies.every)] == [study, study + 1]


def test_backup_never_overwrites_a_file(database: Database, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "copy.db").write_text("something else")
    with database:
        assert backup(database, tmp_path / "copy.db") == 2
    assert "exists already" in capsys.readouterr().err
    assert (tmp_path / "copy.db").read_text() == "something else"


def test_backup_into_a_folder_that_is_not_there_leaves_nothing(database: Database, tmp_path: Path) -> None:
    with database:
        assert backup(database, tmp_path / "nowhere" / "copy.db") == 1
    assert not (tmp_path / "nowhere").exists()


@pytest.mark.postgres
def test_postgresql_is_backed_up_and_restored_as_the_page_says(
    postgres: PostgresServer, postgres_template: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    first, second = postgres.new_database(postgres_template), postgres.new_database()
    dump = tmp_path / "backup.dump"
    with Database(postgres.url(first)) as database:
        database.write_now(fill)
        assert kitchenmind.main(["backup", "--database", postgres.url(first), "--to", str(dump)]) == 2
        assert "pg_dump" in capsys.readouterr().err
        subprocess.run([programs() / "pg_dump", "--format=custom", f"--file={dump}", postgres.url(first)], check=True)
    subprocess.run([programs() / "pg_restore", f"--dbname={postgres.url(second)}", dump], check=True)
    migrate(postgres.url(second))
    assert kitchenmind.main(["verify", "--database", postgres.url(second)]) == 0
    with Database(postgres.url(second)) as restored:
        restored.write_now(fill, key="another")
    for name in (first, second):
        postgres.drop_database(name)


def database_commands() -> list[str]:
    """What the guide runs in the container of the database: the backup, and what restores it."""
    guide = (ROOT / "docs" / "guides" / "run_on_a_server.md").read_text(encoding="utf-8")
    return re.findall(r"^docker compose exec -T database (.*)$", guide, re.MULTILINE)


@pytest.mark.postgres
def test_a_backup_of_an_earlier_version_replaces_a_database_of_this_one_as_the_guide_says(
    postgres: PostgresServer, tmp_path: Path
) -> None:
    name, people = "kitchenmind", select(func.count()).select_from(participants)
    with psycopg.connect(postgres.url(), autocommit=True) as connection:
        connection.execute(f"CREATE DATABASE {name}")
    make_as_of(postgres.url(name), EARLIER[-1])
    writer = engines.WriteConnection(engines.normal_url(postgres.url(name)))
    with writer.transaction() as stored:
        fill_old(stored)
    writer.close()
    environment = {**os.environ, "PGHOST": str(postgres.folder), "PATH": f"{programs()}:{os.environ['PATH']}"}
    backup_command, *restore = database_commands()
    subprocess.run(backup_command, shell=True, check=True, cwd=tmp_path, env=environment)
    migrate(postgres.url(name))
    for command in restore:
        subprocess.run(command, shell=True, check=True, cwd=tmp_path, env=environment)
    migrate(postgres.url(name))
    with Database(postgres.url(name), read_only=True) as database:
        assert database.read_now(lambda connection: connection.execute(people).scalar_one()) == 1
    postgres.drop_database(name)


def test_tables_of_a_later_version_that_a_restore_left_are_named(tmp_path: Path) -> None:
    url = f"sqlite:///{tmp_path}/study.db"
    make_as_of(url, "0016")  # before there were reports
    writer = engines.WriteConnection(engines.normal_url(url))
    with writer.transaction() as connection:
        study_reports.create(connection)
    writer.close()
    with pytest.raises(DatabaseTooNew, match=r"study_reports.* already exists.*restore it into an empty database"):
        migrate(url)
