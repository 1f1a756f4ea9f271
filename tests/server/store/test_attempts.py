"""Limits on tries at passwords and codes in a real database: counted before they are checked, separately by origin."""

import asyncio
from datetime import UTC, datetime, timedelta

import pytest

from server.store import admins, attempts
from server.store.attempts import ATTACKED_AFTER, LIMIT, WINDOW
from server.store.database import Database

NOW = datetime(2026, 1, 2, 3, 4, tzinfo=UTC)


def tries_left(database: Database, name: str, origin: str, now: datetime = NOW) -> int:
    """Use up all tries of an origin; how many there were."""
    made = 0
    while database.write_now(attempts.reserve, "password", name, origin, now) is not None:
        made += 1
    return made


def test_an_origin_has_five_tries_of_a_name_and_those_of_nobody_else(database: Database) -> None:
    assert tries_left(database, "ada", "here") == LIMIT
    assert tries_left(database, "ada", "here") == 0
    assert tries_left(database, "mara", "here") == LIMIT, "another account at the same address"
    assert tries_left(database, "ada", "elsewhere") == LIMIT
    assert database.write_now(attempts.reserve, "code", "ada", "here", NOW) is not None, "another kind of try"


def test_a_try_says_how_many_are_left_and_can_be_taken_back(database: Database) -> None:
    reserved = [database.write_now(attempts.reserve, "password", "ada", "here", NOW) for _ in range(LIMIT)]
    assert [one.left for one in reserved if one] == [4, 3, 2, 1, 0]
    assert reserved[2] is not None
    database.write_now(attempts.release, reserved[2])
    assert tries_left(database, "ada", "here") == 1


def test_tries_come_back_after_a_quarter_of_an_hour_and_leave_nothing_behind(database: Database) -> None:
    assert tries_left(database, "ada", "here") == LIMIT
    assert tries_left(database, "ada", "here", NOW + WINDOW - timedelta(seconds=1)) == 0
    assert tries_left(database, "ada", "here", NOW + WINDOW) == LIMIT
    rows = database.read_now(lambda connection: connection.exec_driver_sql("select at from attempts").all())
    assert len(rows) == LIMIT


def test_a_name_that_many_attack_keeps_a_try_for_everybody_who_has_not_tried(database: Database) -> None:
    for number in range(ATTACKED_AFTER):
        database.write_now(attempts.reserve, "password", "ada", f"attacker {number}", NOW)
    assert tries_left(database, "ada", "the owner") == 1
    assert tries_left(database, "mara", "the owner") == LIMIT


def test_tries_from_before_the_clock_was_set_back_lock_nobody_out(database: Database) -> None:
    for ahead in (timedelta(days=2), timedelta(hours=1)):
        assert tries_left(database, "ada", "here", NOW + ahead) == LIMIT
        assert tries_left(database, "ada", "here") == LIMIT
        database.write_now(attempts.forget, "ada")
    assert tries_left(database, "ada", "here", NOW + WINDOW / 2) == LIMIT
    assert tries_left(database, "ada", "here") == 0, "a small step gives no more tries"


@pytest.mark.parametrize("change", ["set_password", "remove"])
def test_a_new_password_or_removal_forgets_what_was_tried(database: Database, change: str) -> None:
    database.write_now(admins.create, "ada", "a hash", "own")
    assert tries_left(database, "ada", "here") == LIMIT
    assert tries_left(database, "mara", "here") == LIMIT
    if change == "remove":
        database.write_now(admins.remove, "ada")
    else:
        database.write_now(admins.set_password, "ada", "another hash")
    assert tries_left(database, "ada", "here") == LIMIT
    assert tries_left(database, "mara", "here") == 0


async def test_tries_at_the_same_moment_are_counted_one_by_one(database: Database) -> None:
    tries = [database.write(attempts.reserve, "password", "ada", "here", NOW) for _ in range(30)]
    assert len([one for one in await asyncio.gather(*tries) if one is not None]) == LIMIT


@pytest.mark.postgres
@pytest.mark.parametrize("url", ["postgresql"], indirect=True)
async def test_several_server_processes_share_one_limit(url: str) -> None:
    with Database(url, shared=True, in_turn=True) as one, Database(url, shared=True, in_turn=True) as other:
        tries = [
            process.write(attempts.reserve, "password", "ada", "here", NOW)
            for _ in range(10)
            for process in (one, other)
        ]
        assert len([one for one in await asyncio.gather(*tries) if one is not None]) == LIMIT
