"""The time line of a replay, drawn in a browser from a record of a game."""

from typing import Any

import pytest
from playwright.sync_api import Page

pytestmark = [pytest.mark.browser, pytest.mark.timeout(90)]
TITLES = """async (record) => {
  const { TimeLine } = await import('/static/js/replay/timeline.js');
  const axis = document.createElement('div');
  new TimeLine(axis, document.createElement('div'), () => {}).show(record, 0);
  return [...axis.querySelectorAll('.away, .stop')].map((mark) => mark.textContent);
}"""

LANES = """async (record) => {
  const { TimeLine } = await import('/static/js/replay/timeline.js');
  const table = document.createElement('div');
  new TimeLine(document.createElement('div'), table, () => {}).show(record, 0);
  return table.textContent;
}"""


def titles(page: Page, seat: int, pauses: list[dict[str, Any]]) -> list[str]:
    """What the marks of the pauses say in a game of 400 timesteps, of which one was played."""
    row = {"t": 0, "rewards": [0, 0], "late": False, "late_ms": 0, "models_ms": 0, "actions": None, "prediction": []}
    game = {"seat": seat, "watched_seat": 1 - max(0, seat), "horizon": 400, "deadline_ms": 0}
    found: list[str] = page.evaluate(TITLES, {"game": game, "rows": [row], "inputs": [], "pauses": pauses})
    return found


def pause(reason: str, seat: int | None, duration_ms: float | None = 5000.0) -> dict[str, Any]:
    return {"t": 7, "reason": reason, "duration_ms": duration_ms, "seat": seat}


def test_a_pause_says_whose_absence_it_was(blank: Page) -> None:
    pauses = [pause("hidden", 0), pause("lost", 1, None), pause("researcher", None), pause("blur", None)]
    assert titles(blank, 0, pauses) == [
        "absence of the blue chef (hidden), 5.0 s at t 7",
        "absence of the green chef (lost) at t 7",
        "researcher, 5.0 s at t 7",
        "blur, 5.0 s at t 7",
    ]


def test_the_chef_of_the_person_in_seat_1_is_blue_as_on_the_board(blank: Page) -> None:
    assert titles(blank, 1, [pause("hidden", 1)]) == ["absence of the blue chef (hidden), 5.0 s at t 7"]


@pytest.mark.parametrize(("people", "word", "other"), [(1, "AI", "Partner"), (2, "Partner", "AI")])
def test_a_watched_person_is_not_called_an_ai(blank: Page, people: int, word: str, other: str) -> None:
    row = {"t": 0, "rewards": [0, 0], "late": False, "late_ms": 0, "models_ms": 0, "keys": [], "actions": None}
    game = {"seat": 0, "watched_seat": 1, "horizon": 400, "deadline_ms": 0, "people": people}
    text = blank.evaluate(LANES, {"game": game, "rows": [row | {"prediction": []}], "inputs": [], "pauses": []})
    assert word in text
    assert other not in text
