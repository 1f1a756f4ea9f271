"""Bots rehearse a study that is open to people: they have places, turns and counts of their own."""

import asyncio

import pytest

from server.monitoring.enrolment_flow import Stock, arms_of, flow_of, stock
from server.participation import progress
from server.participation.progress import ConsentArrival
from server.participation.served_studies import Studies
from server.store import overview, participants, withdrawal
from server.store.database import Database
from server.store.participants import Participant
from server.study.assignment import StudyFullError
from server.study.definition import Study
from server.study.loader import parse_study
from tests.server.web.participant.test_filling_a_study import ONE_EACH


@pytest.fixture
def studies(database: Database) -> Studies:
    return asyncio.run(Studies.opened(database, [parse_study(ONE_EACH)]))


def arrive(database: Database, studies: Studies, simulated: bool) -> Participant:
    arrival = ConsentArrival("small", participants.new_token(), simulated=simulated)
    return database.write_now(progress.enrol, studies, arrival)


def opened(studies: Studies) -> tuple[tuple[int, ...], Study]:
    found = studies.open("small")
    assert found is not None
    return (found[0],), found[1]


def counted(database: Database, study_ids: tuple[int, ...]) -> Stock:
    return database.read_now(stock, database.read_now(overview.group_to_show, study_ids))


def test_bots_take_neither_the_places_nor_the_turns_of_people(database: Database, studies: Studies) -> None:
    bots = [arrive(database, studies, simulated=True) for _ in range(2)]
    with pytest.raises(StudyFullError):
        arrive(database, studies, simulated=True)
    people = [arrive(database, studies, simulated=False) for _ in range(2)]
    for one, other in zip(bots, people, strict=True):
        assert (one.condition, one.seed) == (other.condition, other.seed)
        assert one.allocation_number == other.allocation_number
        assert [step.seed for step in studies.steps_of(one)] == [step.seed for step in studies.steps_of(other)]
    assert [one.number for one in (*bots, *people)] == [1, 2, 3, 4], "names of participants are never given twice"
    with pytest.raises(StudyFullError):
        arrive(database, studies, simulated=False)


def test_a_bot_that_withdraws_is_not_counted_as_a_person_who_did(database: Database, studies: Studies) -> None:
    bot = arrive(database, studies, simulated=True)
    database.write_now(withdrawal.withdraw, bot.id)
    person = arrive(database, studies, simulated=False)
    assert person.allocation_number == 1
    assert database.read_now(participants.counts, (bot.study_id,)) == {person.condition: {"active": 1}}
    assert database.read_now(participants.counts, (bot.study_id,), True) == {bot.condition: {"withdrawn": 1}}


def test_the_dashboard_counts_people_and_bots_separately(database: Database, studies: Studies) -> None:
    study_ids, study = opened(studies)
    names = {"with": "with", "without": "without"}
    bots = [arrive(database, studies, simulated=True) for _ in range(2)]
    rehearsal = counted(database, study_ids)
    assert rehearsal.simulated
    assert [(arm["active"], arm["simulated"]) for arm in arms_of(study, rehearsal, names, blind=False)] == [(1, 0)] * 2
    person = arrive(database, studies, simulated=False)
    both = counted(database, study_ids)
    assert not both.simulated
    arms = {arm["name"]: arm for arm in arms_of(study, both, names, blind=False)}
    assert {name: arm["active"] for name, arm in arms.items()} == {
        name: int(name == person.condition) for name in names
    }
    assert {name: arm["simulated"] for name, arm in arms.items()} == dict.fromkeys(names, 1)
    assert flow_of(study, both)[0]["reached"] == 1
    assert database.read_now(overview.simulated, study_ids) == len(bots)
