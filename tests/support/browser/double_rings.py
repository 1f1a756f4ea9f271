"""A round in Double Rings as the fake game server plays it, for tests of what the page shows."""

from typing import Any

import pytest
from playwright.sync_api import Page

from server.play.messages import Welcome
from tests.support.browser.fake_game_server import RINGS, FakeGameServer, kitchen, tick, welcome
from tests.support.browser.game_page import (
    drawn,
)

# Double Rings: the partner at (7, 3) with a soup walks up, turns to the hatch, serves.
WALK_TURN_SERVE = ((0, 95), (2, 80), (5, 60))


MOMENT: dict[str, Any] = {
    "players": ((3, 3, 2, 1), (7, 3, 2, 3)),
    "counters": ((6, 2, 2), (4, 4, 1)),
    "pots": ((4, 0, 3, 12), (6, 0, 2, -1)),
    "score": 40,
    "soups": 2,
}


def rings(**changes: Any) -> Welcome:
    """A round in Double Rings. Its ticks are long: no mark becomes stale while a test looks at it."""
    state = kitchen(t=194, **MOMENT)
    named = {"title": "Double Rings", "layout": "double_rings"}
    return welcome(**{"grid": RINGS, "tick_ms": 5000, "state": state, **named, **changes})


@pytest.fixture
def server(server: FakeGameServer) -> FakeGameServer:
    server.welcome = rings()
    return server


def shown(page: Page, server: FakeGameServer, state: Any, prediction: Any, **more: Any) -> None:
    """Send a tick and wait until its marks are there in full."""
    server.send(tick(state, prediction, **more))
    page.wait_for_selector(f"[data-timestep='{state.t}']")
    drawn(page, 220)
