from datetime import UTC, datetime, timedelta
from pathlib import Path

import pytest
from sqlalchemy import Connection, delete, func, select, update
from sqlalchemy.exc import DBAPIError

from server.store import answers, audit, events, overview, participants, studies
from server.store.database import Database
from server.store.migrate import migrate
from server.store.participants import NewParticipant
from server.store.tables import audit as audit_table
from server.store.tables import metadata
from server.store.tables import participants as participant_table
from server.store.withdrawal import withdraw
from tests.support.study_data import fill, new_participant


@pytest.fixture
def study_id(database: Database) -> int:
    return database.write_now(studies.register, "ring", "text").id


def test_same_study_file_is_the_same_version_and_a_changed_one_the_next(database: Database) -> None:
    first = database.write_now(studies.register, "ring", "one")
    assert database.write_now(studies.register, "ring", "one") == first
    assert database.write_now(studies.register, "ring", "two").version == 2
    assert database.write_now(studies.register, "matrix", "one").version == 1


def test_participants_are_numbered_by_consent_and_freeze_the_study(database: Database, study_id: int) -> None:
    ids = [database.write_now(new_participant, study_id) for _ in range(3)]
    found = database.read_now(participants.of_study, study_id)
    assert [(row.id, row.number) for row in found] == list(zip(ids, (1, 2, 3), strict=True))
    study = database.read_now(studies.get, study_id)
    assert study is not None
    assert study.frozen_at is not None
    assert study.started == 3


def test_participant_comes_back_with_all_that_was_given(database: Database, study_id: int) -> None:
    token = participants.new_token()
    new = NewParticipant(study_id, "tom", 2**63 - 1, token, "de", True, "P1", {"contact": "somebody@example.org"})
    made = database.write_now(participants.create, new)
    assert database.read_now(participants.get, made.id) == made
    assert database.read_now(participants.by_token, token) == made
    assert (made.seed, made.language, made.simulated, made.status) == (2**63 - 1, "de", True, "active")
    assert made.started_at.utcoffset() == timedelta(0)
    kept = database.read_now(participants.personal_of, made.id)
    assert kept == {"contact": "somebody@example.org", "recruitment_id": "P1"}


def test_person_who_comes_twice_is_one_participant_and_only_the_new_token_counts(
    database: Database, study_id: int
) -> None:
    first = database.write_now(participants.create, NewParticipant(study_id, "tom", 1, "token-1", recruitment_id="P1"))
    again = database.write_now(participants.create, NewParticipant(study_id, "none", 2, "token-2", recruitment_id="P1"))
    assert again == first
    assert database.read_now(participants.by_token, "token-1") is None
    assert database.read_now(participants.by_token, "token-2") == first
    assert database.read_now(participants.by_recruitment_id, study_id, "P1") == first


def test_same_person_may_be_in_two_studies(database: Database, study_id: int) -> None:
    other = database.write_now(studies.register, "matrix", "text").id
    first = database.write_now(new_participant, study_id, recruitment_id="P1")
    assert database.write_now(new_participant, other, recruitment_id="P1") != first


def test_same_contact_of_two_participants_is_not_an_error(database: Database, study_id: int) -> None:
    for _ in range(2):
        person = database.write_now(new_participant, study_id)
        database.write_now(participants.add_personal, person, study_id, "contact", "shared@example.org")


def test_step_submitted_twice_moves_on_once(database: Database, study_id: int) -> None:
    person = database.write_now(new_participant, study_id)
    assert database.write_now(participants.advance, person, 0, 1)
    assert not database.write_now(participants.advance, person, 0, 1)
    found = database.read_now(participants.get, person)
    assert found is not None
    assert found.position == 1


def test_completion_code_never_changes(database: Database, study_id: int) -> None:
    person = database.write_now(new_participant, study_id)
    assert database.write_now(participants.complete, person, "FIRST") == "FIRST"
    assert database.write_now(participants.complete, person, "SECOND") == "FIRST"
    assert not database.write_now(participants.advance, person, 0, 1)


def test_counts_are_by_status_and_condition(database: Database, study_id: int) -> None:
    people = [database.write_now(new_participant, study_id, condition) for condition in ("tom", "tom", "tom", "none")]
    database.write_now(participants.complete, people[0], None)
    database.write_now(participants.leave, people[1], "screened_out")
    database.write_now(withdraw, people[3])
    counts = database.read_now(participants.counts, (study_id,))
    assert counts == {"tom": {"completed": 1, "screened_out": 1, "active": 1}, "none": {"withdrawn": 1}}


def test_people_away_too_long_lose_their_place(database: Database, study_id: int) -> None:
    person = database.write_now(new_participant, study_id)
    assert database.write_now(participants.time_out, study_id, datetime.now(UTC) - timedelta(hours=1)) == 0
    assert database.write_now(participants.time_out, study_id, datetime.now(UTC) + timedelta(hours=1)) == 1
    found = database.read_now(participants.get, person)
    assert found is not None
    assert found.status == "timed_out"


def test_number_of_somebody_who_withdrew_is_never_given_again(database: Database, study_id: int) -> None:
    database.write_now(new_participant, study_id)
    database.write_now(withdraw, database.write_now(new_participant, study_id))
    last = database.read_now(participants.get, database.write_now(new_participant, study_id))
    assert last is not None
    assert last.number == 3


def test_first_answer_to_a_question_stays(database: Database, study_id: int) -> None:
    person = database.write_now(new_participant, study_id)
    assert database.write_now(answers.save, answers.SubmittedPage(person, "page", {"a": 7, "b": ["x", None, 1.5]})) == 2
    assert database.write_now(answers.save, answers.SubmittedPage(person, "page", {"a": 1, "c": "new"})) == 1
    assert database.read_now(answers.of_participant, person) == {"page": {"a": 7, "b": ["x", None, 1.5], "c": "new"}}


def test_visit_lasts_from_entering_to_leaving(database: Database, study_id: int) -> None:
    person = database.write_now(new_participant, study_id)
    assert database.write_now(answers.leave, person, "page") is None
    database.write_now(answers.enter, person, "page")
    took_ms = database.write_now(answers.leave, person, "page")
    assert took_ms is not None
    assert took_ms >= 0


def test_events_come_back_as_they_were(database: Database, study_id: int) -> None:
    person = database.write_now(new_participant, study_id)
    happened = events.Event("trouble", datetime.now(UTC), person, None, {"text": 'TypeError: "x"', "n": [1, None]})
    database.write_now(events.add, happened, events.Event("rtt", datetime.now(UTC), person))
    assert database.read_now(events.of_participant, person, "trouble") == [happened]
    assert len(database.read_now(events.of_participant, person)) == 2


def rows_with(connection: Connection, word: str) -> dict[str, int]:
    """In how many rows of which table the word occurs."""
    found = {}
    for table in metadata.sorted_tables:
        count = sum(word in repr(tuple(row)) for row in connection.execute(select(table)))
        if count:
            found[table.name] = count
    return found


def test_withdrawal_leaves_a_count_and_no_occurrence_of_the_person(database: Database) -> None:
    study_id = database.write_now(fill)
    person, other = database.read_now(participants.of_study, study_id)[:2]
    database.write_now(audit.add, "anna", "exclude", {"participant": person.id})
    database.write_now(audit.add, "anna", "exclude", {"participant": other.id})
    assert set(database.read_now(rows_with, person.id)) >= {"participants", "personal", "episodes", "answers", "audit"}
    untouched = database.read_now(rows_with, other.id)
    assert database.write_now(withdraw, person.id)
    assert not database.write_now(withdraw, person.id)
    for word in (person.id, f"PROLIFICring{0:06d}"):
        assert database.read_now(rows_with, word) == {}
    assert database.read_now(rows_with, other.id) == untouched
    assert database.read_now(audit.first_forged) is None
    assert database.read_now(participants.counts, (study_id,))[person.condition]["withdrawn"] == 1


def test_withdrawal_leaves_no_trace_in_the_files_of_sqlite(tmp_path: Path) -> None:
    url = f"sqlite:///{tmp_path}/study.db"
    migrate(url)
    with Database(url) as database:
        study_id = database.write_now(fill, people=6, per_person=3)
        person = database.read_now(participants.of_study, study_id)[2]
        database.write_now(withdraw, person.id)
        for path in tmp_path.iterdir():
            if path.suffix in (".db-wal", ".db-shm", ".lock"):
                assert person.id.encode() not in path.read_bytes(), path
    # The file itself only when no connection is open: closing it again would drop SQLite's locks.
    assert person.id.encode() not in (tmp_path / "study.db").read_bytes()
    assert b"PROLIFICring000002" not in (tmp_path / "study.db").read_bytes()
    assert b"PROLIFICring000001" in (tmp_path / "study.db").read_bytes()


def test_audit_log_shows_a_changed_and_a_missing_entry(database: Database) -> None:
    for number in range(4):
        database.write_now(audit.add, "anna", "pause_game", {"number": number})
    assert database.read_now(audit.first_forged) is None
    assert [entry.detail for entry in database.read_now(audit.entries)] == [{"number": number} for number in range(4)]

    def forge(connection: Connection) -> None:
        if connection.dialect.name == "sqlite":
            connection.exec_driver_sql("DROP TRIGGER audit_keeps_content")
        else:
            connection.exec_driver_sql("ALTER TABLE audit DISABLE TRIGGER ALL")
        connection.execute(update(audit_table).where(audit_table.c.id == 3).values(actor="somebody else"))

    database.write_now(forge)
    assert database.read_now(audit.first_forged) == 3


@pytest.mark.parametrize("kept", [0, 1, 3], ids=["all", "most", "the last"])
def test_audit_log_shows_that_its_last_entries_are_missing(database: Database, kept: int) -> None:
    for number in range(4):
        database.write_now(audit.add, "anna", "pause_game", {"number": number})

    def forge(connection: Connection) -> None:
        if connection.dialect.name == "sqlite":
            connection.exec_driver_sql("DROP TRIGGER audit_keeps_entries")
        else:
            connection.exec_driver_sql("ALTER TABLE audit DISABLE TRIGGER ALL")
        connection.execute(delete(audit_table).where(audit_table.c.id > kept))

    database.write_now(forge)
    assert database.read_now(audit.first_forged) == kept + 1
    database.write_now(audit.add, "anna", "sign in")
    assert database.read_now(audit.first_forged) == kept + 1, "what comes later hides nothing"


def test_audit_log_shows_that_its_end_was_forgotten(database: Database) -> None:
    database.write_now(audit.add, "anna", "pause_game")

    def forge(connection: Connection) -> None:
        if connection.dialect.name == "sqlite":
            connection.exec_driver_sql("DROP TRIGGER audit_head_stays")
        else:
            connection.exec_driver_sql("ALTER TABLE audit_head DISABLE TRIGGER ALL")
        connection.exec_driver_sql("DELETE FROM audit_head")

    database.write_now(forge)
    assert database.read_now(audit.first_forged) == 2


@pytest.mark.parametrize(
    "statement",
    [
        "DELETE FROM audit",
        "UPDATE audit SET actor = 'nobody'",
        "DELETE FROM audit_head",
        "UPDATE audit_head SET entries = 0",
    ],
)
def test_database_itself_refuses_to_change_the_audit_log(database: Database, statement: str) -> None:
    database.write_now(audit.add, "anna", "pause_game")
    with pytest.raises(DBAPIError, match="audit log cannot be changed"):
        database.write_now(lambda connection: connection.exec_driver_sql(statement))


def test_only_so_many_events_of_one_kind_and_person_are_stored(database: Database, study_id: int) -> None:
    one, other = database.write_now(new_participant, study_id), database.write_now(new_participant, study_id)
    for person in (one, one, one, other):
        database.write_now(events.add_at_most, events.Event("trouble", datetime.now(UTC), person), 2)
    database.write_now(events.add_at_most, events.Event("reload", datetime.now(UTC), one), 2)
    kinds = [[event.kind for event in database.read_now(events.of_participant, who)] for who in (one, other)]
    assert kinds == [["trouble", "trouble", "reload"], ["trouble"]]


def test_an_open_page_of_a_deleted_participant_stores_no_event(database: Database, study_id: int) -> None:
    person = database.write_now(new_participant, study_id)
    database.write_now(withdraw, person)
    event = events.Event("trouble", datetime.now(UTC), person)
    assert database.write_now(events.add_at_most, event, 2) is False


def test_naive_time_is_refused(database: Database, study_id: int) -> None:
    person = database.write_now(new_participant, study_id)
    with pytest.raises(Exception, match="no time zone"):
        database.write_now(events.add, events.Event("reload", datetime(2026, 1, 1), person))


def test_failed_enrolment_leaves_no_gap_in_the_numbers(database: Database, study_id: int) -> None:
    database.write_now(participants.create, NewParticipant(study_id, "tom", 1, "same token"))
    with pytest.raises(DBAPIError):
        database.write_now(participants.create, NewParticipant(study_id, "tom", 1, "same token"))
    assert (
        database.read_now(lambda connection: connection.execute(select(func.max(participant_table.c.number))).scalar())
        == 1
    )
    second = database.read_now(participants.get, database.write_now(new_participant, study_id))
    assert second is not None
    assert second.number == 2


def test_errors_of_browsers_are_listed_with_the_labels_of_people_and_bots(database: Database, study_id: int) -> None:
    for simulated in (False, True):
        new = NewParticipant(study_id, "tom", 1, participants.new_token(), simulated=simulated)
        made = database.write_now(participants.create, new)
        error = events.Event("trouble", datetime.now(UTC), made.id, detail={"text": "it broke"})
        database.write_now(events.add, error)
    listed = database.read_now(overview.client_errors, [study_id])
    assert [(who, text) for _, _, who, text in listed] == [("B-002", "it broke"), ("P-001", "it broke")]
