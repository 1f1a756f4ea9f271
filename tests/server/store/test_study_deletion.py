"""All data of a study go at the end of its retention period: no table is forgotten, and no other study is touched."""

from datetime import UTC, datetime

import pytest
from sqlalchemy import Connection, select
from sqlalchemy import text as sql

from server.store import (
    answers,
    arrivals,
    audit,
    enrolment_limits,
    episodes,
    interventions,
    participants,
    studies,
    study_deletion,
    study_openings,
    study_reports,
    tombstones,
    withdrawal,
)
from server.store import tables as t
from server.store.database import Database
from tests.support.study_data import SPEC, fill, new_participant

# Where the rows of these go is said in withdrawal.py and study_deletion.py themselves.
OWN = {t.studies, t.participants, t.episodes, t.study_reports}


def open_from_a_draft(connection: Connection, study_id: int) -> None:
    now = datetime.now(UTC)
    changes = {"created_by": "anna", "created_at": now, "changed_by": "anna", "changed_at": now}
    draft = t.study_drafts.insert().values(name="ring", revision=1, source="name: ring", **changes)
    number = connection.execute(draft.returning(t.study_drafts.c.id)).scalar_one()
    study_openings.open_study(connection, ("ring", study_id), (number, 1), "anna")


def second_version(connection: Connection) -> int:
    """Add a version of the study with two participants who share a round, a bot, and all that is stored of a study."""
    study_id = studies.register(connection, "ring", "name: ring\ntitle: second\n").id
    one, other = new_participant(connection, study_id), new_participant(connection, study_id)
    bot = participants.NewParticipant(study_id, "tom", 1, participants.new_token(), simulated=True)
    withdrawal.withdraw(connection, participants.create(connection, bot).id)
    shared = episodes.create(connection, episodes.NewEpisode(SPEC, "shared", (one, other), study_id))
    episodes.create(connection, episodes.NewEpisode(SPEC, "nobody's", (None, None), study_id))
    answers.save(connection, answers.SubmittedPage(other, "after", {"partner": 5}, shared))
    interventions.exclude(connection, one, None, ("other", "slept"), "anna")
    interventions.exclude(connection, other, shared, ("other", "slept"), "anna")
    interventions.pause_study(connection, "ring", "anna")
    open_from_a_draft(connection, study_id)
    arrivals.count(connection, study_id, arrivals.OPENED)
    enrolment_limits.turn_away(connection, "ring", datetime.now(UTC))
    number = study_reports.begin(connection, "ring", "anna", "reading")
    assert number is not None
    study_reports.finish(connection, number, b"of the participants", 3, False)
    audit.add(connection, "anna", "exclude", {"participant": one})
    audit.add(connection, "anna", "end game", {"episode": shared})
    return study_id


@pytest.fixture
def two_studies(filled: Database) -> Database:
    filled.write_now(second_version)
    filled.write_now(lambda connection: fill(connection, people=2, key="other"))
    return filled


def delete(database: Database, most: int | None = None) -> study_deletion.StudyData:
    data = database.read_now(study_deletion.data_of, "ring")
    database.write_now(study_deletion.begin, data, False, "retention period ended")
    for participant_id in data.participants[:most]:
        database.write_now(study_deletion.delete_participant, participant_id)
    if most is None:
        database.write_now(study_deletion.finish, "ring")
    return data


def rows(database: Database, study: str) -> dict[str, int]:
    """Return how many rows of each table belong to a study by one of its columns."""

    def count(connection: Connection) -> dict[str, int]:
        versions = studies.ids_of(connection, study)
        people = select(t.participants.c.id).where(t.participants.c.study_id.in_(versions))
        played = select(t.episodes.c.id).where(t.episodes.c.study_id.in_(versions))
        mine = {"participant_id": people, "episode_id": played, "study_id": versions, "study": [study]}
        return {
            f"{table.name}.{name}": len(connection.execute(select(table).where(table.c[name].in_(values))).all())
            for table in t.metadata.sorted_tables
            for name, values in mine.items()
            if name in table.c
        }

    return database.read_now(count)


def everything(database: Database) -> str:
    def read(connection: Connection) -> list[str]:
        return [str(connection.execute(sql(f"select * from {table.name}")).all()) for table in t.metadata.sorted_tables]

    return "\n".join(database.read_now(read))


def test_every_table_with_rows_of_a_study_is_deleted_or_kept_on_purpose() -> None:
    by_column = {
        "participant_id": set(withdrawal.OF_PARTICIPANTS),
        "episode_id": {*withdrawal.OF_EPISODES, t.answers},  # answers go with their participant
        "study_id": {*study_deletion.OF_STUDIES, *study_deletion.KEPT, t.personal, *OWN},
        "study": {*study_deletion.KEPT, *OWN},
    }
    targets = {"participants": "participant_id", "episodes": "episode_id", "studies": "study_id"}
    for table in t.metadata.sorted_tables:
        for column in table.c:
            kinds = {targets.get(key.column.table.name, "") for key in column.foreign_keys} | {column.name}
            for kind in kinds & by_column.keys():
                is_seat = table is t.episodes and column.name in ("participant_0", "participant_1")
                assert is_seat or table in by_column[kind], (
                    f"{table.name}.{column.name}: see server/store/withdrawal.py"
                )


def test_all_rows_of_all_versions_go_and_no_row_of_another_study(two_studies: Database) -> None:
    before, of_other = rows(two_studies, "ring"), rows(two_studies, "other")
    kept = {"study_openings.study", "study_openings.study_id", "study_pauses.study"}
    assert all(before.values()), "the test has a row in every table"
    ids = [one.id for number in (1, 2) for one in two_studies.read_now(participants.of_study, number)]
    played = two_studies.read_now(lambda c: c.execute(select(t.episodes.c.id, t.episodes.c.study_id)).all())
    ids += [row.id for row in played if row.study_id in (1, 2)]
    delete(two_studies)
    assert {name for name, count in rows(two_studies, "ring").items() if count} <= kept
    assert rows(two_studies, "other") == of_other
    stored = everything(two_studies)
    assert not [word for word in (*ids, "PROLIFICring", "turned away") if word in stored]
    assert two_studies.read_now(study_deletion.data_of, "ring").is_empty


def test_the_audit_log_says_who_deleted_what_and_why(two_studies: Database) -> None:
    data = delete(two_studies)
    entry = two_studies.read_now(audit.entries)[-1]
    assert (entry.actor, entry.action) == ("command line", "delete study")
    numbers = {"participants": 5, "simulated participants": 0, "episodes": 8}
    assert entry.detail == {"study": "ring", "reason": "retention period ended"} | numbers
    assert numbers.items() <= data.counts.items()
    assert two_studies.read_now(audit.first_forged) is None
    assert [one.action for one in two_studies.read_now(audit.entries)].count("delete study") == 1


def test_the_study_can_be_used_again_and_numbers_its_participants_as_if_nothing_was_deleted(
    two_studies: Database,
) -> None:
    delete(two_studies)
    assert [one.version for one in two_studies.read_now(studies.every, "ring")] == [1, 2]
    two_studies.write_now(new_participant, 2)
    (person,) = two_studies.read_now(participants.of_study, 2)
    assert person.number == 7, "no two participants ever had one number"


def test_next_to_a_server_the_study_must_be_paused_or_closed(filled: Database) -> None:
    def check() -> None:
        filled.read_now(study_deletion.check_idle, "ring", True)

    filled.write_now(open_from_a_draft, 1)
    with pytest.raises(ValueError, match="neither paused nor closed"):
        check()
    filled.read_now(study_deletion.check_idle, "ring", False)
    filled.write_now(study_openings.close_study, "ring", "anna")
    check()
    filled.write_now(open_from_a_draft, 1)
    filled.write_now(interventions.pause_study, "ring", "anna")
    check()
    filled.write_now(interventions.resume_study, "ring", "anna")
    with pytest.raises(ValueError, match="neither paused nor closed"):
        check()


def test_an_interrupted_deletion_is_finished_by_the_next_one(two_studies: Database) -> None:
    first = delete(two_studies, most=2)
    stones = two_studies.read_now(tombstones.every)
    second = delete(two_studies)
    assert second.counts["participants"] == first.counts["participants"] - 2
    every = two_studies.read_now(tombstones.every)
    assert {one.hash for one in stones} < {one.hash for one in every}
    for participant_id in first.participants:
        assert sum(stone.is_of(participant_id) for stone in every) == 1


def test_participants_who_joined_during_the_deletion_stay_and_are_reported(two_studies: Database) -> None:
    delete(two_studies, most=5)
    person = two_studies.write_now(new_participant, 2)
    with pytest.raises(ValueError, match="1 joined ring during the deletion"):
        two_studies.write_now(study_deletion.finish, "ring")
    assert two_studies.read_now(participants.get, person) is not None
