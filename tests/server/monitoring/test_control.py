"""Commands on running games: pauses of a game and of its study, and games whose database does not commit."""

import asyncio
from collections.abc import Sequence
from types import SimpleNamespace
from typing import Any, cast

import pytest

from server.monitoring import control as control_module
from server.monitoring.commands import EndGame, EndGames, ExtendAbsence, PauseGame, PauseStudy, ResumeGame, ResumeStudy
from server.monitoring.control import Control
from server.play import messages as m
from server.play.game import Game
from server.play.pause_reasons import RESEARCHER, STUDY
from server.play.recorder import EpisodeRecord
from server.store import events, interventions
from server.store.database import DatabaseDown
from tests.support.live_fakes import make_spec
from tests.support.running_games import RunningGames, running, until

__all__ = ["running"]


@pytest.fixture
def control(running: RunningGames, monkeypatch: pytest.MonkeyPatch) -> Control:
    monkeypatch.setattr(control_module, "BUSY_S", 0.1)
    return Control(running.games, cast(Any, None), cast(Any, None))


def control_of_study(running: RunningGames, versions: Sequence[int] = (1,)) -> Control:
    """Return the control of a server whose games all belong to version 1 of the study "two"."""

    async def read(_: Any, *episodes: str) -> dict[str, Any]:
        return {episode: SimpleNamespace(study_id=1) for episode in episodes}

    studies = SimpleNamespace(versions=lambda _: tuple(versions))
    return Control(running.games, cast(Any, SimpleNamespace(read=read)), cast(Any, studies))


async def pause_study(control: Control, game: Game) -> None:
    await control.run(PauseStudy("two"))
    await until(lambda: STUDY in game.session.pause_reasons)


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


async def test_a_game_that_was_paused_by_itself_stays_paused_when_its_study_continues(running: RunningGames) -> None:
    _, game = await running.under_way()
    control = control_of_study(running)
    await control.run(PauseGame("e1"))
    await pause_study(control, game)
    assert await control.run(ResumeStudy("two")) == 1
    assert game.session.phase == "paused"
    await control.run(ResumeGame("e1"))
    assert game.session.moving
    await control.stop()


async def test_games_continue_although_the_database_is_away_when_their_study_is_resumed(running: RunningGames) -> None:
    _, game = await running.under_way()
    control = control_of_study(running)
    await pause_study(control, game)
    running.specs["e2"] = running.specs["e1"]
    await running.play("e2")  # nobody has read yet of which study it is

    async def down(*_: object) -> None:
        raise DatabaseDown("away")

    cast(Any, control._database).read = down
    assert await control.run(ResumeStudy("two")) == 1
    assert game.session.moving
    await control.stop()


async def test_resuming_one_game_does_not_move_it_while_its_study_is_paused(running: RunningGames) -> None:
    connection, game = await running.under_way()
    control = control_of_study(running)
    await pause_study(control, game)
    connection.sent.clear()
    await control.run(ResumeGame("e1"))
    assert game.session.phase == "paused"
    assert connection.of(m.Paused) == [m.Paused("researcher", 0.0)]
    await control.stop()


async def test_games_of_a_version_that_opened_during_a_pause_are_paused_and_resumed_too(
    running: RunningGames,
) -> None:
    running.specs["e1"] = make_spec(horizon=400)
    versions = [2]
    control = control_of_study(running, versions)
    await control.run(PauseStudy("two"))
    _, game = await running.under_way()
    versions.append(1)
    await until(lambda: STUDY in game.session.pause_reasons)
    await control.run(ResumeStudy("two"))
    assert game.session.moving
    await control.stop()


@pytest.mark.parametrize("is_stored", [False, True])
async def test_a_pause_of_one_game_follows_the_database_although_its_command_is_lost(
    running: RunningGames, monkeypatch: pytest.MonkeyPatch, is_stored: bool
) -> None:
    monkeypatch.setattr(control_module, "FOLLOW_EVERY_S", 0.01)
    running.specs["e1"] = make_spec(horizon=400)
    _, game = await running.under_way()
    stored: dict[Any, Any] = {
        interventions.paused_studies: set(),
        interventions.paused_games: set(),
        events.more_time_s: {},
    }

    async def read(function: Any, *_: str) -> Any:
        return stored[function]

    control = Control(running.games, cast(Any, SimpleNamespace(read=read)), cast(Any, None))
    if is_stored:
        stored[interventions.paused_games] = {"e1"}
    else:
        game.pause(RESEARCHER, "researcher")
    await control.begin(shared=True)
    await until(lambda: (RESEARCHER in game.session.pause_reasons) is is_stored)
    await control.stop()


async def test_more_time_follows_the_database_although_its_command_is_lost(
    running: RunningGames, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(control_module, "FOLLOW_EVERY_S", 0.01)
    running.specs["e1"] = make_spec(horizon=400)
    connection, game = await running.under_way()
    game.pause(0, "hidden")
    before_s = connection.of(m.Paused)[-1].left_s
    stored: dict[Any, Any] = {interventions.paused_studies: set(), interventions.paused_games: set()}

    async def read(function: Any, *_: str) -> Any:
        return stored.get(function, {"e1": 600.0})

    control = Control(running.games, cast(Any, SimpleNamespace(read=read)), cast(Any, None))
    await control.begin(shared=True)
    await until(lambda: connection.of(m.Paused)[-1].left_s > before_s)
    await control.stop()
    assert game.session.pause_reasons.next_absence_s(0.0) > 600.0
    assert await control.run(ExtendAbsence("e1", 300.0)) == 1, "an earlier one that comes late"
    assert game.session.pause_reasons.next_absence_s(0.0) > 600.0


async def test_a_command_reaches_a_game_that_is_just_being_taken_up(running: RunningGames, control: Control) -> None:
    may_load, load = asyncio.Event(), running.games._load

    async def load_slowly(episode: str) -> EpisodeRecord | None:
        record = await load(episode)
        await may_load.wait()
        return record

    running.games._load = load_slowly
    joining = asyncio.create_task(running.play())
    await asyncio.sleep(0.01)
    pausing = asyncio.create_task(control.run(PauseGame("e1")))
    await asyncio.sleep(0)
    may_load.set()
    assert await pausing == 1
    await joining
    game = running.games.get("e1")
    assert game is not None
    assert not game.session.moving
