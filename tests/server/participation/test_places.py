"""Places of a study with several versions, and of people whom a pause keeps waiting."""

import asyncio
from dataclasses import replace
from datetime import UTC, datetime, timedelta

import pytest
from sqlalchemy import text as sql

from server.monitoring.arm_names import arm_names
from server.monitoring.enrolment_flow import arms_of, stock
from server.participation import places, progress
from server.participation.progress import ConsentArrival
from server.participation.served_studies import Studies
from server.store import interventions, participants
from server.store.database import Database
from server.store.overview import Group
from server.store.participants import Participant, label
from server.store.tables import participants as people
from server.store.tables import study_pauses
from server.study.assignment import StudyFullError
from server.study.loader import parse_study
from tests.server.web.participant.test_filling_a_study import ONE_EACH

TWO_EACH = ONE_EACH.replace("quota: 1}", "quota: 2}")
NEW_ARM = ONE_EACH.replace("agents:", "  - {name: third, predictor: random}\nagents:", 1)
NOON = datetime(2026, 3, 1, 12, tzinfo=UTC)


@pytest.fixture
def studies(database: Database) -> Studies:
    return asyncio.run(Studies.opened(database, [parse_study(TWO_EACH)]))


def arrive(database: Database, studies: Studies) -> Participant:
    return database.write_now(progress.enrol, studies, ConsentArrival("small", participants.new_token()))


def open_version(database: Database, studies: Studies, text: str) -> None:
    studies.let_into("small", asyncio.run(studies.add(database, parse_study(text))))


def away(database: Database, minutes: float, *who: Participant) -> None:
    """They sent their first page, and were last seen these minutes ago."""
    at = datetime.now(UTC) - timedelta(minutes=minutes)
    query = people.update().where(people.c.id.in_([one.id for one in who]))
    database.write_now(lambda connection: connection.execute(query.values(last_seen_at=at, position=1)))


def paused(database: Database, minutes_ago: float, until_minutes_ago: float | None) -> None:
    now = datetime.now(UTC)
    until = None if until_minutes_ago is None else now - timedelta(minutes=until_minutes_ago)
    row = {"study": "small", "paused_by": "mara", "paused_at": now - timedelta(minutes=minutes_ago)}
    database.write_now(lambda connection: connection.execute(study_pauses.insert().values(row | {"resumed_at": until})))


def status(database: Database, who: Participant) -> str:
    found = database.read_now(participants.get, who.id)
    assert found is not None
    return found.status


def test_a_new_version_does_not_fill_the_quotas_once_more(database: Database, studies: Studies) -> None:
    for _ in range(3):
        arrive(database, studies)
    open_version(database, studies, TWO_EACH.replace("A small study", "A small study, typo corrected") + "\n")
    arrive(database, studies)
    with pytest.raises(StudyFullError):
        arrive(database, studies)


def test_a_larger_quota_of_a_new_version_lets_the_difference_in(database: Database, studies: Studies) -> None:
    for _ in range(4):
        arrive(database, studies)
    open_version(database, studies, TWO_EACH.replace("quota: 2}", "quota: 3}"))
    assert sorted(arrive(database, studies).condition for _ in range(2)) == ["with", "without"]
    with pytest.raises(StudyFullError):
        arrive(database, studies)


REPLACING = TWO_EACH.replace("\nagents:", "\nreplace_excluded: true\nagents:", 1)


def completed(database: Database, studies: Studies, number: int) -> list[Participant]:
    """So many people complete the study."""
    found = [arrive(database, studies) for _ in range(number)]
    query = people.update().where(people.c.id.in_([one.id for one in found]))
    done = {"status": "completed", "completed_at": datetime.now(UTC), "position": 3}
    database.write_now(lambda connection: connection.execute(query.values(done)))
    return found


def exclude(database: Database, who: Participant) -> int:
    return database.write_now(interventions.exclude, who.id, None, ("attention", ""), "mara")


@pytest.mark.parametrize("text", [TWO_EACH, REPLACING], ids=["kept", "replaced"])
def test_an_excluded_participant_who_completed_is_replaced_if_the_study_says_so(database: Database, text: str) -> None:
    studies = asyncio.run(Studies.opened(database, [parse_study(text)]))
    first, *_ = completed(database, studies, 4)
    exclude(database, first)
    if text == TWO_EACH:
        with pytest.raises(StudyFullError):
            arrive(database, studies)
        return
    study = studies.open("small")
    assert study is not None
    held = database.read_now(stock, Group(studies.versions("small")))
    targets = {arm["name"]: arm["target"] for arm in arms_of(study[1], held, arm_names(study[1], False), False)}
    assert targets == {name: 3 if name == first.condition else 2 for name in ("with", "without")}
    assert arrive(database, studies).condition == first.condition
    with pytest.raises(StudyFullError):
        arrive(database, studies)


def test_who_is_counted_again_after_a_replacement_gives_nobody_a_place(database: Database) -> None:
    studies = asyncio.run(Studies.opened(database, [parse_study(REPLACING)]))
    first, *_ = completed(database, studies, 4)
    number = exclude(database, first)
    arrive(database, studies)
    database.write_now(interventions.restore, number, "mara")
    with pytest.raises(StudyFullError):
        arrive(database, studies)


def test_a_condition_that_a_new_version_adds_takes_turns_with_the_others(database: Database, studies: Studies) -> None:
    for _ in range(2):
        arrive(database, studies)
    open_version(database, studies, NEW_ARM.replace("quota: 1}", "quota: 9}"))
    assert sorted(arrive(database, studies).condition for _ in range(3)) == ["third", "with", "without"]


def test_somebody_of_an_earlier_version_who_stays_away_gives_the_place_back(
    database: Database, studies: Studies
) -> None:
    gone, *_ = [arrive(database, studies) for _ in range(4)]
    open_version(database, studies, TWO_EACH + "\n")
    with pytest.raises(StudyFullError):
        arrive(database, studies)
    away(database, 24 * 60, gone)
    assert arrive(database, studies).condition == gone.condition
    assert status(database, gone) == "timed_out"


def test_somebody_silent_in_an_earlier_version_keeps_the_place_while_the_new_quota_has_room(
    database: Database, studies: Studies
) -> None:
    silent, *_ = [arrive(database, studies) for _ in range(4)]
    at = datetime.now(UTC) - timedelta(minutes=30)
    database.write_now(lambda connection: connection.execute(people.update().values(started_at=at)))
    for _ in range(4):
        arrive(database, studies)
    silent = replace(silent, started_at=at)
    open_version(database, studies, TWO_EACH.replace("quota: 2}", "quota: 3}"))
    assert not database.write_now(places.is_lost, studies, silent)
    open_version(database, studies, TWO_EACH + "\n")
    assert database.write_now(places.is_lost, studies, silent)


def test_participants_of_all_versions_have_names_of_their_own(database: Database, studies: Studies) -> None:
    everybody = [arrive(database, studies) for _ in range(2)]
    open_version(database, studies, TWO_EACH + "\n")
    everybody += [arrive(database, studies) for _ in range(2)]
    assert [label(one.number) for one in everybody] == ["P-001", "P-002", "P-003", "P-004"]
    assert [one.allocation_number for one in everybody] == [1, 2, 1, 2], "order and seeds are those of the version"


def test_nobody_loses_the_place_because_a_researcher_paused_the_study(database: Database, studies: Studies) -> None:
    waiting, gone = arrive(database, studies), arrive(database, studies)
    away(database, 600 + 100, waiting)
    away(database, 600 + 130, gone)
    paused(database, 610, 10)
    arrive(database, studies)
    assert status(database, waiting) == "active", "100 minutes away, without the ten hours of the pause"
    assert status(database, gone) == "timed_out"


def test_a_silent_participant_holds_the_place_through_a_pause(database: Database, studies: Studies) -> None:
    silent = arrive(database, studies)
    at = datetime.now(UTC) - timedelta(minutes=60)
    database.write_now(lambda connection: connection.execute(people.update().values(started_at=at)))
    paused(database, 58, 1)
    found = studies.open("small")
    assert found is not None
    assert database.read_now(places.held, (found[0],), found[1])[silent.condition].held == 1
    database.write_now(lambda connection: connection.execute(sql("delete from study_pauses")))
    assert database.read_now(places.held, (found[0],), found[1])[silent.condition].held == 0


@pytest.mark.parametrize(
    ("pauses", "expected"),
    [
        ([], 60),
        ([(200, 100)], 60),
        ([(40, 10)], 90),
        ([(40, None)], 100),
        ([(300, 30), (20, 10)], 340),
        ([(20, 10), (300, 30)], 340),
        ([(40, 40)], 60),
        ([(0, None)], 60),
    ],
)
def test_the_time_of_pauses_is_left_out(pauses: list[tuple[int, int | None]], expected: int) -> None:
    def ago(minutes: int) -> datetime:
        return NOON - timedelta(minutes=minutes)

    given = [(ago(begun), None if ended is None else ago(ended)) for begun, ended in pauses]
    assert places.unpaused_ago(NOON, timedelta(minutes=60), given) == ago(expected)


def test_the_pauses_of_a_study_are_its_own(database: Database) -> None:
    database.write_now(interventions.pause_study, "small", "mara")
    database.write_now(interventions.pause_study, "other", "mara")
    database.write_now(interventions.resume_study, "other", "mara")
    ((begun, ended),) = database.read_now(interventions.pauses_of, "small")
    assert ended is None
    assert begun.tzinfo is not None
