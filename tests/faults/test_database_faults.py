"""Rows 4 to 8 and 26 of docs/explanation/faults.md: the database is unavailable, locked, full, unsynced, or used
twice.
"""

import shutil
from pathlib import Path

import pytest

from tests.support.faults import database_scenarios as database

needs_mount = pytest.mark.skipif(not database.can_mount(), reason="only root may mount a small file system")


async def test_games_wait_for_a_locked_database_and_resume_by_themselves(tmp_path: Path) -> None:
    (await database.locked(tmp_path, seconds=2)).hold()


def test_what_was_acknowledged_survives_a_power_cut_and_a_torn_tail_is_cut_off(tmp_path: Path) -> None:
    database.power_cuts(tmp_path, tries=100, seed=4).hold()


def test_a_second_server_waits_for_the_first_to_die(tmp_path: Path) -> None:
    database.second_server(tmp_path).hold()


@needs_mount
async def test_games_wait_for_a_full_disk_and_resume_once_there_is_space(tmp_path: Path) -> None:
    (await database.disk_full(tmp_path, seconds=2)).hold()


@pytest.mark.slow
def test_ten_thousand_power_cuts_lose_nothing(tmp_path: Path) -> None:
    database.power_cuts(tmp_path, tries=10_000, seed=5).hold()


@pytest.mark.slow
async def test_a_lock_of_ten_seconds_costs_time_and_nothing_else(tmp_path: Path) -> None:
    (await database.locked(tmp_path, seconds=10)).hold()


@pytest.mark.slow
@pytest.mark.postgres
async def test_postgresql_that_hangs_for_half_a_minute_acknowledges_nothing(tmp_path: Path) -> None:
    (await database.postgres_frozen(tmp_path, seconds=30)).hold()


@pytest.mark.slow
@pytest.mark.postgres
async def test_postgresql_that_is_killed_and_restarted_is_found_again(tmp_path: Path) -> None:
    (await database.postgres_killed(tmp_path, seconds=5)).hold()


@pytest.mark.slow
@pytest.mark.skipif(shutil.which("strace") is None, reason="strace makes the error")
async def test_a_commit_that_could_not_be_synced_is_never_acknowledged(tmp_path: Path) -> None:
    (await database.sync_fails(tmp_path, seconds=4)).hold()
