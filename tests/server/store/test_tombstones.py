"""Deleted participants stay deleted: importing an older export omits those with a tombstone, which has no personal
data.
"""

import json
import shutil
from collections.abc import Iterator
from dataclasses import dataclass, replace
from datetime import UTC, datetime
from pathlib import Path

import pytest
from sqlalchemy import Connection, select
from sqlalchemy import text as sql

import kitchenmind
from server.store import answers, audit, events, participants, studies, tombstones
from server.store.database import Database
from server.store.tables import episodes, metadata
from server.store.withdrawal import Deletion, withdraw
from tests.server.conftest import KINDS
from tests.support.postgres_pool import PostgresPool
from tests.support.postgres_server import PostgresServer
from tests.support.study_data import fill

# The command refuses what it was given before it asks a database of whatever kind.
of_any_kind = pytest.mark.parametrize("url", ["sqlite"], indirect=True)


@dataclass
class Before:
    """A database of two studies, an export of it, and one person who was deleted after that. The deleted one and the
    mate shared a round, about which the mate answered too."""

    url: str
    export: Path
    person: str
    mate: str
    shared: str


def made(url: str, export: Path) -> Before:
    """Fill a database that has one study, export it and delete somebody."""
    with Database(url) as database:
        number = database.read_now(studies.every)[0].id
        database.write_now(lambda connection: fill(connection, people=1, per_person=1, key="other"))
        person, mate = (one.id for one in database.read_now(participants.of_study, number)[:2])
        shared = database.write_now(play_together, person, mate)
    assert kitchenmind.main(["export", "--database", url, "--out", str(export)]) == 0
    with Database(url) as database:
        assert database.write_now(withdraw, person)
    return Before(url, export, person, mate, shared)


def play_together(connection: Connection, person: str, mate: str) -> str:
    query = select(episodes.c.id).where(episodes.c.participant_0 == person).order_by(episodes.c.number)
    shared: str = connection.execute(query).scalars().first() or ""
    connection.execute(
        episodes.update().where(episodes.c.id == shared).values(participant_1=mate, agent_1=None, step_key="shared")
    )
    answers.save(connection, answers.SubmittedPage(mate, "after", {"partner": 5}, shared))
    return shared


@pytest.fixture(scope="module")
def made_in_sqlite(filled_sqlite: Path, tmp_path_factory: pytest.TempPathFactory) -> Before:
    folder = tmp_path_factory.mktemp("before")
    file = Path(shutil.copy(filled_sqlite, folder / "study.db"))
    return made(f"sqlite:///{file}", folder / "export")


@pytest.fixture(scope="module")
def made_in_postgres(
    postgres: PostgresServer, filled_postgres: str, tmp_path_factory: pytest.TempPathFactory
) -> tuple[Before, PostgresPool]:
    name = postgres.new_database(filled_postgres)
    before = made(postgres.url(name), tmp_path_factory.mktemp("before") / "export")
    return before, PostgresPool(postgres, name)


@pytest.fixture(params=KINDS)
def url(request: pytest.FixtureRequest, tmp_path: Path) -> Iterator[str]:
    """The address of a copy of the database; see `before`."""
    if request.param == "sqlite":
        original: Before = request.getfixturevalue("made_in_sqlite")
        yield f"sqlite:///{shutil.copy(original.url.removeprefix('sqlite:///'), tmp_path / 'study.db')}"
        return
    _, pool = request.getfixturevalue("made_in_postgres")
    with pool.one() as address:
        yield address


@pytest.fixture
def before(request: pytest.FixtureRequest, url: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Before:
    """Copies that a test may change."""
    monkeypatch.setenv("KITCHENMIND_DATABASE", f"sqlite:///{tmp_path}/no server here.db")
    original: Before
    if url.startswith("sqlite"):
        original = request.getfixturevalue("made_in_sqlite")
    else:
        original, _ = request.getfixturevalue("made_in_postgres")
    return replace(original, url=url, export=Path(shutil.copytree(original.export, tmp_path / "before")))


def everything(url: str) -> str:
    """All that is stored, as one text."""

    def read(connection) -> list[str]:  # type: ignore[no-untyped-def]
        return [str(connection.execute(sql(f"select * from {table.name}")).all()) for table in metadata.sorted_tables]

    with Database(url, read_only=True) as database:
        return "\n".join(database.read_now(read))


def imported(before: Before, tmp_path: Path, *more: str, export: Path | None = None) -> str:
    new = f"sqlite:///{tmp_path}/{len(list(tmp_path.iterdir()))}.db"
    assert kitchenmind.main(["import", str(export or before.export), "--database", new, *more]) == 0
    return new


def test_an_import_omits_participants_whom_the_servers_database_lists_as_deleted(
    before: Before, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setenv("KITCHENMIND_DATABASE", before.url)
    new = imported(before, tmp_path)
    assert "1 person who withdrew after this export was made" in capsys.readouterr().out
    stored = everything(new)
    assert before.person not in stored
    assert before.shared not in stored, "rounds of two are records of both"
    assert before.mate in stored
    with Database(new, read_only=True) as database:
        (count,) = [row[0] for row in database.read_now(lambda c: c.execute(sql("select count(*) from withdrawals")))]
        assert count == 1
        assert len(database.read_now(tombstones.every)) == 1
        assert database.read_now(audit.first_forged) is None
        assert database.read_now(answers.of_participant, before.mate)["after"] == {"partner": 5}
        (noted,) = database.read_now(events.of_participant, before.mate, events.PARTNER_WITHDREW)
        assert (noted.episode_id, noted.detail) == (None, {"step": "shared"})
    assert kitchenmind.main(["verify", "--database", new]) == 0


@pytest.mark.parametrize("source", ["database", "export", "file name"])
def test_withdrawn_participants_come_from_a_database_or_a_newer_export(
    before: Before, tmp_path: Path, source: str
) -> None:
    newer = tmp_path / "newer"
    assert kitchenmind.main(["export", "--database", before.url, "--out", str(newer)]) == 0
    given = {"database": before.url, "export": str(newer), "file name": f"{newer}/"}[source]
    assert before.person not in everything(imported(before, tmp_path, "--withdrawn", given))


def test_tombstones_are_kept_from_import_to_export_to_import(before: Before, tmp_path: Path) -> None:
    first = imported(before, tmp_path, "--withdrawn", before.url)
    second = tmp_path / "second"
    assert kitchenmind.main(["export", "--database", first, "--out", str(second)]) == 0
    older = tmp_path / "older with newer tombstones"
    shutil.copytree(before.export, older)
    shutil.copy(second / tombstones.FILE, older / tombstones.FILE)
    again = imported(before, tmp_path, export=older)
    assert before.person not in everything(again)
    with Database(again, read_only=True) as database:
        assert len(database.read_now(tombstones.every)) == 1


@of_any_kind
def test_without_any_source_the_command_reports_that_no_database_was_read(
    before: Before, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    imported(before, tmp_path)
    said = capsys.readouterr().err
    assert "was not asked who withdrew" in said
    assert "--withdrawn" in said


def test_an_export_of_a_version_without_tombstones_can_be_imported(before: Before, tmp_path: Path) -> None:
    (before.export / tombstones.FILE).unlink()
    assert before.mate in everything(imported(before, tmp_path))


@of_any_kind
@pytest.mark.parametrize(
    "text", ["", "[]", "{}", '{"withdrawn": [1]}', '{"withdrawn": [{"hash": "x", "salt": "y", "deleted_at": "z"}]}',
             '{"withdrawn": ' + "[" * 3000 + "]" * 3000 + "}"]
)  # fmt: skip
def test_a_damaged_list_of_who_withdrew_is_refused_and_nothing_is_stored(
    before: Before, tmp_path: Path, capsys: pytest.CaptureFixture[str], text: str
) -> None:
    (before.export / tombstones.FILE).write_text(text, encoding="utf-8")
    new = f"sqlite:///{tmp_path}/damaged.db"
    assert kitchenmind.main(["import", str(before.export), "--database", new]) == 2
    assert tombstones.FILE in capsys.readouterr().err
    with Database(new) as database:
        assert database.read_now(studies.every) == []


def test_a_tombstone_reveals_nothing_about_the_person(before: Before) -> None:
    with Database(before.url, read_only=True) as database:
        (stone,) = database.read_now(tombstones.every)
    assert stone.is_of(before.person)
    assert not stone.is_of(before.mate)
    assert before.person not in everything(before.url)
    assert "PROLIFICring000000" not in everything(before.url)
    with Database(before.url) as database:
        database.write_now(withdraw, before.mate)
        first, second = database.read_now(tombstones.every)
        assert first.salt != second.salt, "each has a salt of its own"


def test_an_export_lists_tombstones_and_no_ids(before: Before, tmp_path: Path) -> None:
    out = tmp_path / "after"
    assert kitchenmind.main(["export", "--database", before.url, "--out", str(out)]) == 0
    text = (out / tombstones.FILE).read_text(encoding="utf-8")
    assert len(json.loads(text)["withdrawn"]) == 1
    assert before.person not in text
    assert tombstones.FILE in (out / "README.md").read_text(encoding="utf-8")


def test_the_same_tombstones_twice_are_kept_once(before: Before) -> None:
    with Database(before.url) as database:
        stones = database.read_now(tombstones.every)
        new = tombstones.Tombstone("ab" * 32, "cd" * 16, datetime(2026, 3, 1, tzinfo=UTC))
        database.write_now(tombstones.add, [*stones, new, new])
        assert {one.hash for one in database.read_now(tombstones.every)} == {stones[0].hash, new.hash}


# On request, by the command line


@pytest.mark.parametrize("by", ["id", "code", "recruiter"])
def test_a_researcher_deletes_somebody_on_request(before: Before, by: str, capsys: pytest.CaptureFixture[str]) -> None:
    with Database(before.url) as database:
        database.write_now(participants.complete, before.mate, "KM-7777-8888")
    who = {"id": before.mate, "code": "km-7777-8888", "recruiter": "PROLIFICring000001"}[by]
    words = ["person", "delete", who, "--study", "ring", "--database", before.url, "--reason", "asked on Monday"]
    assert kitchenmind.main([*words[:1], "find", *words[2:7]]) == 0
    assert before.mate in capsys.readouterr().out
    assert kitchenmind.main(words) == 2, "it asks first, and here nobody can answer"
    assert before.mate in everything(before.url)
    assert kitchenmind.main([*words, "--yes"]) == 0
    stored = everything(before.url)
    for simulation in (before.mate, "KM-7777-8888", "PROLIFICring000001"):
        assert simulation not in stored
    with Database(before.url, read_only=True) as database:
        entry = database.read_now(audit.entries)[-1]
        assert (entry.actor, entry.action) == ("command line", "delete participant")
        assert entry.detail == {"study": "ring", "reason": "asked on Monday"}
        assert database.read_now(audit.first_forged) is None
        assert any(stone.is_of(before.mate) for stone in database.read_now(tombstones.every))


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"--study": "rong"}, "There is: other, ring"),
        ({"who": "nobody"}, "no participant with the id or code 'nobody'"),
        ({"who": "PROLIFICother000000"}, "no participant"),
        ({"who": ""}, "no participant"),
        ({"--database": "sqlite:///no/such/file.db"}, "there is no database"),
    ],
)
def test_missing_files_are_reported_with_a_remedy(
    before: Before, change: dict[str, str], words: str, capsys: pytest.CaptureFixture[str]
) -> None:
    options = {"--study": "ring", "--database": before.url, "--reason": "asked"} | change
    who = options.pop("who", before.mate)
    line = ["person", "delete", who, "--yes", *(word for pair in options.items() for word in pair)]
    assert kitchenmind.main(line) == 2
    said = capsys.readouterr().err
    assert words in said
    assert "Traceback" not in said


def test_a_participant_in_a_game_is_not_deleted_while_the_server_runs(
    before: Before, capsys: pytest.CaptureFixture[str]
) -> None:
    with Database(before.url) as database:
        database.write_now(participants.seen, before.mate)
        running = episodes.update().where(episodes.c.participant_0 == before.mate).values(status="running")
        database.write_now(lambda connection: connection.execute(running))
    line = ["person", "delete", before.mate, "--study", "ring", "--database", before.url, "--reason", "x", "--yes"]
    assert kitchenmind.main(line) == 2
    assert "is in a game now" in capsys.readouterr().err
    assert before.mate in everything(before.url)


def test_a_deletion_while_the_server_runs_neither_waits_nor_is_lost(before: Before) -> None:
    line = ["person", "delete", before.mate, "--study", "ring", "--database", before.url, "--reason", "x", "--yes"]
    with Database(before.url) as server:
        assert kitchenmind.main(line) == 0
        assert server.read_now(participants.get, before.mate) is None
        server.write_now(audit.add, "server", "continues")
        assert server.read_now(audit.first_forged) is None


def test_a_deletion_names_its_actor_and_its_detail(before: Before) -> None:
    with Database(before.url) as database:
        database.write_now(withdraw, before.mate, Deletion("anna", "delete participant", {"reason": "asked"}))
        entry = database.read_now(audit.entries)[-1]
    assert (entry.actor, entry.action) == ("anna", "delete participant")
    assert (entry.detail or {})["reason"] == "asked"
