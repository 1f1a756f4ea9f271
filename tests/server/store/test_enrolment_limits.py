"""New participants by address in a real database, shared by all processes."""

import asyncio
from datetime import UTC, datetime, timedelta

import pytest
from sqlalchemy import Connection

from server.store import enrolment_limits
from server.store.database import Database
from server.store.enrolment_limits import EnrolmentLimit, EnrolmentLimitReached

NOW = datetime(2026, 1, 2, 3, 4, tzinfo=UTC)
LIMITS = [EnrolmentLimit("a network", 3), EnrolmentLimit("its site", 5)]


def enrol(connection: Connection, limits: list[EnrolmentLimit], refuse: bool = False, now: datetime = NOW) -> bool:
    """A transaction as an enrolment makes it. `refuse`: the study turns out to be full."""
    enrolment_limits.check(connection, limits, now)
    enrolment_limits.take(connection, limits, now)
    if refuse:
        raise LookupError
    return True


def is_let_in(database: Database, network: str) -> bool:
    try:
        return database.write_now(enrol, [EnrolmentLimit(network, 3), LIMITS[1]])
    except EnrolmentLimitReached:
        return False


def test_each_limit_counts_on_its_own(database: Database) -> None:
    assert [is_let_in(database, "one") for _ in range(4)] == [True, True, True, False]
    assert [is_let_in(database, "two") for _ in range(3)] == [True, True, False], "the site has brought five"


def test_an_enrolment_that_fails_takes_no_place(database: Database) -> None:
    for _ in range(5):
        with pytest.raises(LookupError):
            database.write_now(enrol, LIMITS, refuse=True)
    assert database.write_now(enrol, LIMITS)


@pytest.mark.postgres
@pytest.mark.parametrize("url", ["postgresql"], indirect=True)
async def test_several_server_processes_share_the_places_of_an_address(url: str) -> None:
    with Database(url, shared=True, in_turn=True) as one, Database(url, shared=True, in_turn=True) as other:
        arrivals = [process.write(enrol, LIMITS) for _ in range(10) for process in (one, other)]
        answers = await asyncio.gather(*arrivals, return_exceptions=True)
    assert answers.count(True) == 3
    assert sum(isinstance(answer, EnrolmentLimitReached) for answer in answers) == 17


def test_people_from_before_the_clock_was_set_back_take_no_places(database: Database) -> None:
    for _ in range(3):
        database.write_now(enrol, [LIMITS[0]], now=NOW + timedelta(days=2))
    assert database.write_now(enrol, [LIMITS[0]])
