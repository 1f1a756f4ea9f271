"""Rows 23 to 25, 27, 29 and 30 of docs/explanation/faults.md: broken models, clock jumps, dashboards, leaving."""

from pathlib import Path

import pytest

from tests.support.faults import model_scenarios as model
from tests.support.faults import people_scenarios as people


async def test_a_killed_server_gives_no_code_without_all_answers(tmp_path: Path) -> None:
    (await people.last_page(tmp_path, tries=8, seed=30)).hold()


async def test_no_file_keeps_data_of_a_participant_who_leaves_in_a_game(tmp_path: Path) -> None:
    (await people.withdrawal(tmp_path)).hold()


async def test_games_and_forms_work_when_the_clock_jumps(tmp_path: Path) -> None:
    (await people.clock_jumps(tmp_path, seconds=0.3)).hold()


@pytest.mark.parametrize("kind", [pytest.param("Slow", marks=pytest.mark.slow), "SometimesNothing"])
async def test_partners_wait_for_a_faulty_agent_and_the_data_record_it(tmp_path: Path, kind: str) -> None:
    (await model.faulty(tmp_path, kind, seconds=3)).hold()


@pytest.mark.slow
async def test_an_agent_that_crashes_its_process_ends_no_game(tmp_path: Path) -> None:
    (await model.faulty(tmp_path, "Dying", seconds=15)).hold()


@pytest.mark.slow
async def test_a_hundred_kills_at_the_last_answer_give_no_code_without_all_answers(tmp_path: Path) -> None:
    (await people.last_page(tmp_path, tries=100, seed=31)).hold()


@pytest.mark.slow
async def test_an_export_and_twenty_dashboards_take_nothing_from_the_games(tmp_path: Path) -> None:
    (await people.busy_dashboard(tmp_path, seconds=8, games=10)).hold()
