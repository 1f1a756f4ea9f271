"""Commands on running games whose database does not commit."""

from typing import Any, cast

import pytest

from server.monitoring import control as control_module
from server.monitoring.commands import EndGame, EndGames, PauseGame
from server.monitoring.control import Control
from server.play.pause_reasons import RESEARCHER
from tests.support.running_games import RunningGames, running, until

__all__ = ["running"]


@pytest.fixture
def control(running: RunningGames, monkeypatch: pytest.MonkeyPatch) -> Control:
    monkeypatch.setattr(control_module, "BUSY_S", 0.1)
    return Control(running.games, cast(Any, None), cast(Any, None))


@pytest.mark.parametrize("command", [EndGame("e1"), EndGames(["e1"])])
async def test_a_game_that_cannot_be_ended_continues_when_the_database_is_back(
    running: RunningGames, control: Control, command: EndGame | EndGames
) -> None:
    connection, game = await running.under_way()
    running.recorder.down = True
    await until(lambda: game.unstored is not None)
    assert await control.run(command) == 0
    running.recorder.down = False
    await until(lambda: connection.closed)
    assert running.ticks() == 41, "nobody knows of a pause that could be resumed"


async def test_a_game_that_a_researcher_pauses_stays_paused_if_it_cannot_be_ended(
    running: RunningGames, control: Control
) -> None:
    _, game = await running.under_way()
    running.recorder.down = True
    await until(lambda: game.unstored is not None)
    assert await control.run(PauseGame("e1")) == 1
    assert await control.run(EndGame("e1")) == 0
    assert RESEARCHER in game.session.pause_reasons
