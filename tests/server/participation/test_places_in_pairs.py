"""Conditions of a study with rounds of two people: who comes next becomes the partner of somebody who waits."""

from datetime import UTC, datetime, timedelta

import pytest

from server.participation import progress
from server.participation.game_seats import Seating
from server.participation.served_studies import Studies
from server.store import participants, tables
from server.store.database import Database
from server.store.participants import Participant
from server.study.loader import parse_study
from server.study.steps import StudyStep
from tests.support.study_text import study_head

STUDY = (
    study_head("pairs", "Two people", seed=5)
    + """
conditions: [{name: tom, predictor: tom}, {name: none, predictor: none}, {name: random, predictor: random}]
agents: [{name: person, human: true, predictor: random}]
layouts: [{name: coordination_ring, title: {en: Ring}}]
flow: [episodes, thanks]
"""
)


class Arrivals:
    """People who come one after the other."""

    def __init__(self, database: Database, studies: Studies) -> None:
        self.database, self.studies, self.count = database, studies, 0

    def come(self, simulated: bool = False) -> Participant:
        self.count += 1
        arrival = progress.ConsentArrival("pairs", f"token-number-{self.count}", simulated=simulated)
        return self.database.write_now(progress.enrol, self.studies, arrival)

    def in_pairs(self, count: int) -> bool:
        conditions = [self.come().condition for _ in range(2 * count)]
        return conditions[::2] == conditions[1::2]


@pytest.fixture
async def arrivals(database: Database) -> Arrivals:
    return Arrivals(database, await Studies.opened(database, [parse_study(STUDY)]))


async def test_two_people_who_come_one_after_the_other_are_in_one_condition(arrivals: Arrivals) -> None:
    assert arrivals.in_pairs(6)
    counts = arrivals.database.read_now(participants.counts, (1,))
    assert counts == {name: {"active": 4} for name in ("tom", "none", "random")}


async def test_somebody_whose_partner_has_left_the_study_waits_for_the_next(arrivals: Arrivals) -> None:
    stays, leaves = arrivals.come(), arrivals.come()
    arrivals.database.write_now(participants.leave, leaves.id, "returned")
    assert arrivals.come().condition == stays.condition


async def test_nobody_is_sent_to_somebody_who_may_have_gone(arrivals: Arrivals) -> None:
    gone = arrivals.come()
    long_ago = datetime.now(UTC) - timedelta(minutes=11)
    query = tables.participants.update().values(last_seen_at=long_ago)
    arrivals.database.write_now(lambda connection: connection.execute(query))
    first, second = arrivals.come(), arrivals.come()
    assert first.condition == second.condition != gone.condition


async def test_somebody_who_still_waits_gets_the_next_as_partner(arrivals: Arrivals) -> None:
    seating = Seating(arrivals.database, arrivals.studies, lambda layout, model: None, "test")
    waits = arrivals.come()
    long_ago = datetime.now(UTC) - timedelta(minutes=11)
    query = tables.participants.update().values(last_seen_at=long_ago)
    arrivals.database.write_now(lambda connection: connection.execute(query))
    assert await seating.outlook(waits.id) == "open"  # the waiting room asks every few seconds
    assert arrivals.come().condition == waits.condition


async def test_a_participant_who_has_met_a_partner_or_plays_alone_waits_for_nobody(arrivals: Arrivals) -> None:
    seating = Seating(arrivals.database, arrivals.studies, lambda layout, model: None, "test")
    first, second, third = arrivals.come(), arrivals.come(), arrivals.come()
    for one in (first, second, third):
        arrivals.database.write_now(
            progress.submit, arrivals.studies, one.id, progress.Submission(ready(arrivals, one))
        )
    assert await seating.seat_two(first.id, second.id)
    await seating.seat_alone(third.id)
    assert first.condition == second.condition != third.condition
    assert arrivals.in_pairs(2)


async def test_bots_and_people_do_not_fill_each_others_pairs(arrivals: Arrivals) -> None:
    arrivals.come(simulated=True)
    assert arrivals.in_pairs(3)


def ready(arrivals: Arrivals, one: Participant) -> StudyStep:
    return arrivals.studies.step(one)
