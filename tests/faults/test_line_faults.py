"""Rows 9 to 12, 16 and 17 of docs/explanation/faults.md: lost, slow, silent and stuttering lines."""

from pathlib import Path

import pytest

from tests.support.faults import line_scenarios as line


async def test_connections_that_are_reset_come_back_at_their_timestep(tmp_path: Path) -> None:
    (await line.hard_resets(tmp_path, tries=3)).hold()


async def test_inputs_that_come_twice_or_late_move_once(tmp_path: Path) -> None:
    (await line.stutter(tmp_path, seconds=2.5)).hold()


async def test_reconnecting_again_and_again_leaves_nothing_behind(tmp_path: Path) -> None:
    (await line.reconnects(tmp_path, tries=60)).hold()


@pytest.mark.slow
async def test_a_thousand_reconnects_leave_nothing_behind(tmp_path: Path) -> None:
    (await line.reconnects(tmp_path, tries=1000)).hold()


@pytest.mark.slow
async def test_everybody_reconnecting_at_once_gets_in_once(tmp_path: Path) -> None:
    (await line.herd(tmp_path, people=100)).hold()


@pytest.mark.slow
async def test_many_resets_lose_and_double_nothing(tmp_path: Path) -> None:
    (await line.hard_resets(tmp_path, tries=60, games=5)).hold()


@pytest.mark.slow
async def test_a_peer_that_vanished_without_closing_is_noticed(tmp_path: Path) -> None:
    (await line.half_open(tmp_path, tries=5)).hold()


@pytest.mark.slow
@pytest.mark.parametrize(("up", "down"), [(True, False), (False, True), (True, True)])
async def test_a_stalled_connection_continues_after_a_while(tmp_path: Path, up: bool, down: bool) -> None:
    (await line.frozen_ways(tmp_path, up, down, seconds=8)).hold()


@pytest.mark.slow
async def test_a_slow_reader_costs_a_bounded_queue_and_nobody_else(tmp_path: Path) -> None:
    (await line.slow_reader(tmp_path, seconds=15)).hold()


@pytest.mark.slow
async def test_a_bad_connection_changes_neither_clock_nor_order(tmp_path: Path) -> None:
    (await line.rough_weather(tmp_path, seconds=20)).hold()
