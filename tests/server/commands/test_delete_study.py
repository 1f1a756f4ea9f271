"""`kitchenmind study delete` shows what it would delete, asks, and works next to a server of a paused study."""

import sys
from io import StringIO
from pathlib import Path

import pytest
from sqlalchemy import Connection, update

import kitchenmind
from server.store import audit, interventions, participants, studies, study_deletion, tombstones
from server.store.database import Database, DatabaseDown
from server.store.migrate import migrate
from server.store.tables import episodes
from tests.support.page_site import SMALL_STUDY, PageSite, Visitor
from tests.support.study_data import fill

REASON = ["--reason", "retention period ended"]


def delete(url: str, *words: str, study: str = "ring") -> int:
    return kitchenmind.main(["study", "delete", study, "--database", url, *(words or ("--yes", *REASON))])


def people(url: str, study: str = "ring") -> list[str]:
    with Database(url, read_only=True) as database:
        return list(database.read_now(study_deletion.data_of, study).participants)


@pytest.fixture
def stored(url: str, filled: Database) -> str:
    """The address of a database with a played study, which no server has open."""
    filled.close()
    return url


def test_it_shows_the_numbers_and_says_what_is_kept_and_what_it_cannot_reach(
    stored: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert delete(stored) == 0
    said = capsys.readouterr().out
    for words in ("3  participants", "6  episodes", "deleted: all data of ring", "kitchenmind backup", "exports"):
        assert words in said
    assert ("VACUUM" in said) == stored.startswith("postgresql")
    assert people(stored) == []
    assert delete(stored) == 0, "a second time there is nothing to do"
    assert "nothing to delete" in capsys.readouterr().out


def test_after_it_the_database_can_be_verified_and_exported_and_an_older_export_brings_nobody_back(
    stored: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    before, after, new = tmp_path / "before", tmp_path / "after", f"sqlite:///{tmp_path}/new.db"
    assert kitchenmind.main(["export", "--database", stored, "--out", str(before)]) == 0
    assert delete(stored) == 0
    assert kitchenmind.main(["verify", "--database", stored]) == 0
    assert kitchenmind.main(["export", "--database", stored, "--out", str(after)]) == 0
    monkeypatch.setenv("KITCHENMIND_DATABASE", stored)
    assert kitchenmind.main(["import", str(before), "--database", new]) == 0
    assert "3 people who withdrew" in capsys.readouterr().out
    assert people(new) == []


def test_without_the_study_s_name_nothing_is_deleted(
    stored: str, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    assert delete(stored, *REASON) == 2, "it asks, and here nobody can answer"
    assert "3  participants" in capsys.readouterr().out, "the numbers are shown first"
    for answer, status in (("yes", 2), ("ring", 0)):
        typed = StringIO(f"{answer}\n")
        monkeypatch.setattr(typed, "isatty", lambda: True)
        monkeypatch.setattr(sys, "stdin", typed)
        assert delete(stored, *REASON) == status
        assert bool(people(stored)) == (status == 2)


@pytest.mark.parametrize(
    ("study", "words", "expected"),
    [
        ("rong", ("--yes", *REASON), "there is no study 'rong' here. There is: ring"),
        ("ring", ("--yes", "--reason", " "), "the reason is empty"),
        ("ring", ("--yes", *REASON, "--database", "sqlite:///no/such/file.db"), "there is no database"),
    ],
)
def test_wrong_input_is_refused_with_a_remedy(
    stored: str, study: str, words: tuple[str, ...], expected: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert delete(stored, *words, study=study) == 2
    said = capsys.readouterr().err
    assert said.startswith("kitchenmind study delete: ")
    assert expected in said
    assert len(people(stored)) == 3


def test_nothing_is_deleted_while_a_participant_is_in_a_game(
    filled: Database, url: str, capsys: pytest.CaptureFixture[str]
) -> None:
    person = filled.read_now(participants.of_study, 1)[1].id
    running = update(episodes).where(episodes.c.participant_0 == person).values(status="running")
    filled.write_now(lambda connection: connection.execute(running))
    filled.write_now(interventions.pause_study, "ring", "anna")
    assert delete(url) == 2
    assert "in a game of ring now: P-002" in capsys.readouterr().err
    assert len(people(url)) == 3


def test_a_game_that_began_during_the_deletion_is_not_deleted_in_its_middle(
    filled: Database, url: str, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """As in a study that was closed: who is in it may finish."""
    filled.write_now(interventions.pause_study, "ring", "anna")
    in_order = people(url)
    last = filled.read_now(participants.get, in_order[-1])
    assert last is not None
    begun = update(episodes).where(episodes.c.participant_0 == last.id).values(status="running")

    begin = study_deletion.begin

    def then_a_game_begins(connection: Connection, data: study_deletion.StudyData, served: bool, reason: str) -> None:
        begin(connection, data, served, reason)
        connection.execute(begun)

    monkeypatch.setattr(study_deletion, "begin", then_a_game_begins)
    assert delete(url) == 2
    assert f"P-00{last.number} has begun a game during the deletion. Repeat it" in capsys.readouterr().err
    assert people(url) == [last.id]


def test_a_study_that_a_server_may_serve_is_paused_first(
    filled: Database, url: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert delete(url) == 2
    said = capsys.readouterr().err
    assert "ring is neither paused nor closed. Pause it in the dashboard (/admin/s/ring), or stop the server" in said
    assert len(people(url)) == 3
    assert [one.action for one in filled.read_now(audit.entries)] == ["pause_study"]
    filled.write_now(interventions.pause_study, "ring", "anna")
    assert delete(url) == 0
    assert people(url) == []
    filled.write_now(audit.add, "server", "continues")
    assert filled.read_now(audit.first_forged) is None


def test_a_failing_database_gives_exit_status_1_and_the_next_call_deletes_the_rest(
    stored: str, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    last, whole = people(stored)[-1], study_deletion.delete_participant

    def fails(connection: object, participant_id: str) -> None:
        if participant_id == last:
            raise DatabaseDown("the disk is full")
        whole(connection, participant_id)  # type: ignore[arg-type]

    monkeypatch.setattr(study_deletion, "delete_participant", fails)
    assert delete(stored) == 1
    assert "Repeat the command to delete the rest" in capsys.readouterr().err
    assert people(stored) == [last]
    monkeypatch.undo()
    assert delete(stored) == 0
    with Database(stored, read_only=True) as database:
        assert len(database.read_now(tombstones.every)) == 3


def test_no_trace_is_left_in_the_files_of_sqlite(tmp_path: Path) -> None:
    file = tmp_path / "study.db"
    migrate(f"sqlite:///{file}")
    with Database(f"sqlite:///{file}") as server:
        server.write_now(fill, people=6, per_person=3)
        server.write_now(interventions.pause_study, "ring", "anna")
        ids = people(f"sqlite:///{file}")
        assert delete(f"sqlite:///{file}") == 0
        written = [path.read_bytes() for path in tmp_path.iterdir() if path.suffix == ".db-wal"]
    written.append(file.read_bytes())
    for word in (*ids, "PROLIFICring"):
        assert not [content for content in written if word.encode() in content]


@pytest.mark.filterwarnings("error")
def test_pages_of_a_running_server_treat_deleted_participants_as_unknown(tmp_path: Path) -> None:
    with PageSite(tmp_path, SMALL_STUDY) as site:
        visitor, unknown = Visitor(site), Visitor(site)
        visitor.consent("small")
        fields = visitor.fields()
        site.database.write_now(interventions.pause_study, "small", "anna")
        assert delete(f"sqlite:///{tmp_path}/site.db", study="small") == 0
        assert site.everybody("small") == []
        for path in ("/s/small/now", "/s/small", "/s/small/withdraw"):
            page, of_unknown = visitor.get(path), unknown.get(path)
            assert (page.status_code, page.url) == (of_unknown.status_code, of_unknown.url)
        assert "A short break" in visitor.send("/s/small/now", fields).text
        site.database.write_now(interventions.resume_study, "small", "anna")
        visitor.consent("small")
        assert [one.number for one in site.everybody("small")] == [2]
        assert site.database.read_now(studies.started, "small") == 2


def test_a_server_starts_with_the_versions_of_a_study_whose_data_were_deleted(tmp_path: Path) -> None:
    with PageSite(tmp_path, SMALL_STUDY) as site:
        Visitor(site).consent("small")
    assert delete(f"sqlite:///{tmp_path}/site.db", study="small") == 0
    with PageSite(tmp_path, SMALL_STUDY.replace("seed: 11", "seed: 12")) as site:
        Visitor(site).consent("small")
        assert site.studies.versions("small") == (2, 1)
        assert site.only("small").number == 2
