"""Reports in the database: the newest is kept, one is made at a time, and none outlives a withdrawal."""

from datetime import UTC, datetime, timedelta

from sqlalchemy import Connection, update

from server.store import participants, study_reports
from server.store.database import Database
from server.store.tables import study_reports as table
from server.store.withdrawal import withdraw
from tests.support.study_data import fill


def made(database: Database, study: str = "ring", archive: bytes = b"files") -> int:
    number = database.write_now(study_reports.begin, study, "mara", "reading")
    assert number is not None
    assert database.write_now(study_reports.finish, number, archive, 3, False)
    return number


def seen_long_ago(connection: Connection) -> None:
    connection.execute(update(table).values(seen_at=datetime.now(UTC) - timedelta(minutes=5)))


def test_a_new_report_takes_the_place_of_the_one_before(database: Database) -> None:
    made(database, archive=b"old")
    number = made(database, archive=b"new")
    newest, kept = database.read_now(study_reports.newest, "ring")
    assert newest is not None
    assert newest == kept
    assert (newest.id, newest.participants, newest.is_running, newest.reason) == (number, 3, False, "")
    assert database.read_now(study_reports.archive_of, "ring") == b"new"
    assert database.read_now(study_reports.newest, "other") == (None, None)


def test_one_report_is_made_at_a_time_and_the_kept_one_stays_when_it_fails(database: Database) -> None:
    made(database, archive=b"old")
    number = database.write_now(study_reports.begin, "ring", "mara", "reading")
    assert number is not None
    assert database.write_now(study_reports.begin, "other", "ben", "reading") is None
    database.write_now(study_reports.fail, number, "ring", "mara", "no space is left")
    newest, kept = database.read_now(study_reports.newest, "ring")
    assert newest is not None
    assert kept is not None
    assert (newest.reason, kept.reason) == ("no space is left", "")
    assert database.read_now(study_reports.archive_of, "ring") == b"old"
    assert database.write_now(study_reports.begin, "other", "ben", "reading") is not None


def test_a_report_whose_server_is_gone_blocks_no_other(database: Database) -> None:
    database.write_now(study_reports.begin, "ring", "mara", "reading")
    database.write_now(seen_long_ago)
    newest, _ = database.read_now(study_reports.newest, "ring")
    assert newest is not None
    assert not newest.is_running
    assert "The server stopped" in newest.reason
    assert database.write_now(study_reports.begin, "other", "ben", "reading") is not None


def test_a_withdrawal_deletes_the_study_s_reports_and_the_one_that_is_being_made(database: Database) -> None:
    study_id = database.write_now(fill, 1)
    (person,) = database.read_now(participants.of_study, study_id)
    made(database)
    made(database, "other")
    number = database.write_now(study_reports.begin, "ring", "mara", "reading")
    assert number is not None
    assert database.write_now(withdraw, person.id)
    assert database.read_now(study_reports.newest, "ring") == (None, None)
    assert not database.write_now(study_reports.finish, number, b"with the person", 1, False)
    database.write_now(study_reports.fail, number, "ring", "mara", study_reports.WITHDRAWN)
    newest, kept = database.read_now(study_reports.newest, "ring")
    assert newest is not None
    assert (newest.reason, kept) == (study_reports.WITHDRAWN, None)
    assert database.read_now(study_reports.archive_of, "other") == b"files"


def test_an_unfinished_report_from_before_the_clock_was_set_back_blocks_no_other(database: Database) -> None:
    database.write_now(study_reports.begin, "ring", "mara", "reading")
    ahead = datetime.now(UTC) + timedelta(days=2)
    database.write_now(lambda connection: connection.execute(update(table).values(seen_at=ahead)))
    assert database.write_now(study_reports.begin, "other", "ben", "reading") is not None
