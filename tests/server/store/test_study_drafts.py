"""Drafts keep every text that was written; of two editors of the same draft, one is told of the other's change."""

from datetime import timedelta

import pytest

from server.store import audit, participants, studies, study_drafts, study_openings
from server.store.database import Database
from server.store.study_drafts import DraftConflict, DraftText, StudyDraft
from server.store.study_openings import StudyClosed
from tests.support.study_data import new_participant


def begun(database: Database) -> int:
    return database.write_now(study_drafts.create, DraftText("mara", "name: one\n", "one", note="created"))


def saved(database: Database, draft: int, author: str, source: str, based_on: int, note: str = "edited") -> object:
    return database.write_now(study_drafts.save, draft, DraftText(author, source, "one", based_on, note))


def texts(database: Database, draft: int) -> list[tuple[str, str, str]]:
    return [(one.author, one.note, one.source) for one in database.read_now(study_drafts.history, draft)]


def test_changes_are_saved_on_top_of_each_other_and_kept_with_their_author(database: Database) -> None:
    draft = begun(database)
    first = saved(database, draft, "mara", "a", 1)
    assert isinstance(first, StudyDraft)
    assert (first.revision, first.source, first.changed_by) == (2, "a", "mara")
    saved(database, draft, "mara", "ab", 2)
    saved(database, draft, "ben", "abc", 3)
    now = database.read_now(study_drafts.get, draft)
    assert now is not None
    assert (now.revision, now.source, now.changed_by, now.created_by) == (4, "abc", "ben", "mara")
    assert texts(database, draft) == [
        ("ben", "edited", "abc"),
        ("mara", "edited", "ab"),
        ("mara", "created", "name: one\n"),
    ]
    told = [(entry.actor, entry.action) for entry in database.read_now(audit.entries)]
    assert told == [("mara", "study draft created"), ("mara", "study draft edited"), ("ben", "study draft edited")]


def test_saving_on_top_of_an_older_revision_is_reported_and_loses_nothing(database: Database) -> None:
    draft = begun(database)
    saved(database, draft, "mara", "hers", 1)
    conflict = saved(database, draft, "ben", "his", 1)
    assert isinstance(conflict, DraftConflict)
    assert (conflict.newest.source, conflict.newest.revision, conflict.newest.changed_by) == ("hers", 2, "mara")
    assert texts(database, draft)[0] == ("ben", "set aside", "his")
    assert isinstance(saved(database, draft, "ben", "his, again", 1), DraftConflict)
    saved(database, draft, "mara", "hers, later", 2)
    assert isinstance(saved(database, draft, "ben", "his, of another conflict", 2), DraftConflict)
    set_aside = [source for _, note, source in texts(database, draft) if note == "set aside"]
    assert set_aside == ["his, of another conflict", "his, again", "his"], "each text of each conflict"
    merged = saved(database, draft, "mara", "both", 3, "merged")
    assert isinstance(merged, StudyDraft)
    assert {"hers, later", "both"} <= {source for _, _, source in texts(database, draft)}


def test_a_text_that_comes_with_its_base_is_not_set_aside_by_itself(database: Database) -> None:
    draft = begun(database)
    saved(database, draft, "mara", "hers", 1)
    text = DraftText("ben", "his", "one", 1, base="name: one\n")
    assert isinstance(database.write_now(study_drafts.save, draft, text), DraftConflict)
    assert [source for _, _, source in texts(database, draft)] == ["hers", "name: one\n"]
    database.write_now(study_drafts.set_aside, draft, text)
    was = [database.read_now(study_drafts.was_saved, draft, source) for source in ("hers", "his", "other")]
    assert was == [True, False, False]


def test_the_same_text_sent_twice_is_not_a_conflict(database: Database) -> None:
    draft = begun(database)
    saved(database, draft, "mara", "a", 1)
    again = saved(database, draft, "mara", "a", 1)
    assert isinstance(again, StudyDraft)
    assert again.revision == 2


def test_a_later_sitting_is_a_line_of_its_own(database: Database, monkeypatch: pytest.MonkeyPatch) -> None:
    draft = begun(database)
    saved(database, draft, "mara", "a", 1)
    monkeypatch.setattr(study_drafts, "ONE_SITTING", timedelta(0))
    saved(database, draft, "mara", "b", 2)
    assert [source for _, _, source in texts(database, draft)] == ["b", "a", "name: one\n"]


def test_two_who_write_at_the_same_time_add_a_line_each_and_not_one_with_every_save(database: Database) -> None:
    draft = begun(database)
    for revision in range(1, 13):
        author, note = ("mara", "ben")[revision % 2], ("edited", "merged")[revision // 2 % 2]
        saved(database, draft, author, f"text {revision}", revision, note)
    kept = texts(database, draft)
    assert sorted(set(kept)) == sorted(kept)
    assert {(author, note) for author, note, _ in kept[:-1]} == {
        (author, note) for author in ("mara", "ben") for note in ("edited", "merged")
    }
    assert len(kept) == 5
    assert kept[0][2] == "text 12"


def test_an_edit_after_a_restored_text_is_a_line_of_its_own(database: Database) -> None:
    draft = begun(database)
    saved(database, draft, "mara", "a", 1)
    saved(database, draft, "ben", "old", 2, "restored")
    saved(database, draft, "mara", "old, changed", 3)
    assert [source for _, _, source in texts(database, draft)] == ["old, changed", "old", "a", "name: one\n"]


def test_a_deleted_draft_is_gone_and_its_history_is_not(database: Database) -> None:
    draft = begun(database)
    assert database.write_now(study_drafts.delete, draft)
    assert database.read_now(study_drafts.get, draft) is None
    assert database.read_now(study_drafts.every) == []
    assert saved(database, draft, "mara", "late", 1) is None
    assert len(texts(database, draft)) == 1


def test_a_study_is_open_until_it_is_closed_and_can_be_opened_again(database: Database) -> None:
    draft = begun(database)
    one, two = (database.write_now(studies.register, "one", text) for text in ("first", "second"))
    for version in (one, two):
        database.write_now(study_openings.open_study, ("one", version.id), (draft, 1), "mara")
    newest = database.read_now(study_openings.newest)["one"]
    assert (newest.sha256, newest.draft_revision, newest.is_open) == (two.sha256, 1, True)
    assert database.read_now(study_openings.closed) == set()
    assert database.write_now(study_openings.close_study, "one", "ben")
    assert not database.write_now(study_openings.close_study, "one", "ben")
    assert database.read_now(study_openings.closed) == {"one"}
    assert database.read_now(study_openings.needed) == []
    with pytest.raises(StudyClosed):
        database.read_now(study_openings.check_open, "one")
    database.write_now(study_openings.open_study, ("one", two.id), (draft, 1), "ben")
    database.read_now(study_openings.check_open, "one")
    assert [each.study for each in database.read_now(study_openings.needed)] == ["one"]


def test_a_closed_study_is_needed_while_somebody_is_in_any_of_its_versions(database: Database) -> None:
    draft = begun(database)
    one, two = (database.write_now(studies.register, "one", text) for text in ("first", "second"))
    for version in (one, two):
        database.write_now(study_openings.open_study, ("one", version.id), (draft, 1), "mara")
    person = database.write_now(new_participant, one.id)
    database.write_now(study_openings.close_study, "one", "ben")
    assert [each.study_id for each in database.read_now(study_openings.needed)] == [two.id]
    database.write_now(participants.leave, person, "returned")
    assert database.read_now(study_openings.needed) == []
