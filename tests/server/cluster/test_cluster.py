"""Two server processes with one PostgreSQL and one Redis: researchers at one see and control the games of the other."""

import asyncio
import time
from collections.abc import AsyncIterator
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import httpx
import pytest

from server.bots.cook import Traits
from server.bots.game_client import BotGame, Journal
from server.bots.participant import Bot
from server.cluster.registry import Cluster
from server.monitoring.commands import (
    AnyGameCommand,
    EndGame,
    MessageStudy,
    PauseGame,
    PauseStudy,
    ResumeGame,
    ResumeStudy,
    SendMessage,
)
from server.monitoring.peers import Process, View
from server.play.game import Game
from server.store import enrolment_limits, interventions, ticks
from server.study.loader import StudyError
from tests.support.live_server import LiveServer
from tests.support.postgres_pool import PostgresPool
from tests.support.redis_server import RedisServer
from tests.support.server_pair import PAIR_STUDY, Pair, until

pytestmark = pytest.mark.postgres


def running(live: LiveServer) -> Game | None:
    """Its first game, once it runs."""
    return next((game for game in live.app.state.services.games if game.session.phase == "running"), None)


@pytest.fixture
async def bot(pair: Pair) -> AsyncIterator[Bot]:
    """Play at the first server."""
    made = Bot(pair[0].url, "short", 1)
    page = await made.consent()
    while not page.is_game:
        page = await made.submit(page)
    playing = asyncio.create_task(made.game().play())
    await until(lambda: running(pair[0]))
    yield made
    playing.cancel()
    await asyncio.gather(playing, return_exceptions=True)
    await made.close()


def peers(live: LiveServer) -> list[Any]:
    """What the dashboard of this server sees of the others."""
    services = live.app.state.services
    return live.do(lambda: services.live.views(services.web.studies.versions("short")))


def runs(live: LiveServer, command: AnyGameCommand) -> bool:
    """Whether the command reached its game from this process."""
    reached: bool = live.do(lambda: live.app.state.services.control.run(command))
    return reached


async def test_the_dashboard_of_one_process_shows_the_games_of_the_other(pair: Pair, bot: Bot) -> None:
    here, there = pair
    game = running(here)
    assert game is not None
    views = await until(lambda: peers(there))
    assert [view.id for view in views] == [game.episode]
    assert views[0].card["who"] == "B-001"
    assert views[0].still["grid"] == list(game.session.simulation.layout.grid)
    later = await until(lambda: [view for view in peers(there) if view.board["state"]["t"] > views[0].card["t"]])
    assert later[0].phase == "running"
    assert peers(here) == []


async def test_a_researcher_reaches_a_game_wherever_it_runs(pair: Pair, bot: Bot) -> None:
    here, there = pair
    game = running(here)
    assert game is not None
    assert runs(there, PauseGame(game.episode))
    await until(lambda: game.session.phase == "paused")
    assert runs(there, SendMessage(game.episode, "Nearly done."))
    assert runs(there, ResumeGame(game.episode))
    await until(lambda: game.session.phase == "running")
    control = there.app.state.services.control
    assert there.do(lambda: control.broadcast(MessageStudy("short", "To all."))) == 1
    there.do(lambda: control.broadcast(PauseStudy("short")))
    await until(lambda: game.session.phase == "paused")
    there.do(lambda: control.broadcast(ResumeStudy("short")))
    await until(lambda: game.session.phase == "running")
    assert runs(there, EndGame(game.episode))
    await until(lambda: len(here.app.state.services.games) == 0)
    assert not runs(there, PauseGame(game.episode))


async def test_another_tab_at_another_process_takes_the_game_over_where_it_stands(pair: Pair, bot: Bot) -> None:
    here, there = pair
    game = running(here)
    assert game is not None
    first = bot.game()
    second = BotGame(first.url.replace(str(here.port), str(there.port)), first.cookie, Journal(), Traits.drawn(2))
    playing = asyncio.create_task(second.play())
    taken = await until(lambda: running(there))
    await until(lambda: len(here.app.state.services.games) == 0)
    assert taken.episode == game.episode
    assert taken.session.simulation.timestep >= game.session.simulation.timestep - 1
    await asyncio.sleep(0.3)
    database = there.app.state.services.web.database
    stored = there.do(lambda: database.read(ticks.of_episode, game.episode))
    assert [tick.timestep for tick in stored] == list(range(len(stored)))
    assert game.session.phase == "ended"
    playing.cancel()
    await asyncio.gather(playing, return_exceptions=True)


async def test_a_paused_game_stays_paused_when_its_page_reaches_another_process(pair: Pair, bot: Bot) -> None:
    here, there = pair
    game = running(here)
    assert game is not None
    database = here.app.state.services.web.database
    here.do(lambda: database.write(interventions.pause_game, game.episode, "ada"))
    await until(lambda: game.session.phase == "paused")
    first = bot.game()
    second = BotGame(first.url.replace(str(here.port), str(there.port)), first.cookie, Journal(), Traits.drawn(2))
    playing = asyncio.create_task(second.play())
    taken = await until(lambda: there.app.state.services.games.get(game.episode))
    await until(lambda: taken.connections and 0 not in taken.session.pause_reasons)
    assert not taken.session.moving
    here.do(lambda: database.write(interventions.pause_game, game.episode, None))
    await until(lambda: taken.session.moving)
    playing.cancel()
    await asyncio.gather(playing, return_exceptions=True)


async def test_games_continue_without_redis_and_the_dashboard_recovers_with_it(
    pair: Pair,
    bot: Bot,
    own_redis: RedisServer,
) -> None:
    here, there = pair
    game = running(here)
    assert game is not None
    await until(lambda: peers(there))
    own_redis.stop()
    stood = game.session.simulation.timestep
    await until(lambda: game.session.simulation.timestep > stood + 10)
    assert game.session.phase == "running"
    assert not runs(there, PauseGame(game.episode))
    own_redis.start()
    await until(lambda: peers(there))


async def test_every_process_reports_the_figures_of_all(pair: Pair, bot: Bot) -> None:
    def games() -> dict[str, float]:
        text = httpx.get(f"{pair[1].url}/metrics").text
        lines = [line.split() for line in text.splitlines() if line.startswith("kitchenmind_games{")]
        return {name: float(value) for name, value in lines}

    found = await until(lambda: (both := games()) and len(both) == 2 and sum(both.values()) == 1 and both)
    assert len(found) == 2


async def test_the_dashboard_of_each_process_names_the_late_one(pair: Pair, bot: Bot) -> None:
    here, there = pair
    game = running(here)
    assert game is not None
    for _ in range(10_000):
        here.app.state.services.games.loop.lateness.add(80.0, time.monotonic() + 60)

    def shown(live: LiveServer) -> list[str]:
        return [str(alert["text"]) for alert in live.app.state.services.alerts.shown("short")]

    def worst(live: LiveServer) -> Any:
        return live.do(live.app.state.services.dashboard._machine)["late_ms"]

    assert (await until(lambda: shown(here)))[0].startswith("Timesteps come late: 80 ms")
    name = here.app.state.services.live.peers.name
    assert (await until(lambda: shown(there)))[0].startswith(f"Timesteps come late in process {name}: 80 ms")
    assert worst(there) == [80.0, 80.0]
    assert not there.app.state.services.alerts.open, "one process tells of it, not every one"


async def test_a_pause_of_a_study_reaches_every_process_although_its_command_is_lost(
    pair: Pair, bot: Bot, own_redis: RedisServer
) -> None:
    here, there = pair
    game = running(here)
    assert game is not None
    own_redis.stop()
    services = there.app.state.services
    there.do(lambda: services.web.database.write(interventions.pause_study, "short", "ada"))
    there.do(lambda: services.control.broadcast(PauseStudy("short")))
    await until(lambda: game.session.phase == "paused")
    there.do(lambda: services.web.database.write(interventions.resume_study, "short", "ada"))
    there.do(lambda: services.control.broadcast(ResumeStudy("short")))
    await until(lambda: game.session.phase == "running")


def alerted(live: LiveServer, words: str) -> int:
    """How many alerts with these words the dashboard of this server lists."""
    return sum(words in str(alert["text"]) for alert in live.app.state.services.alerts.shown("short"))


async def test_the_dashboard_of_each_process_shows_the_alerts_of_all(pair: Pair) -> None:
    here, there = pair
    await until(lambda: all(live.do(live.app.state.services.live.peers.processes) for live in pair))
    database = here.app.state.services.web.database
    here.do(lambda: database.write(enrolment_limits.turn_away, "short", datetime.now(UTC)))
    await until(lambda: alerted(here, "asked for more than") and alerted(there, "asked for more than"))
    assert [alerted(live, "asked for more than") for live in pair] == [1, 1]
    told = [live for live in pair if "places short" in live.app.state.services.alerts.open]
    assert len(told) == 1, "one process tells of it, not every one"


async def test_timesteps_without_the_required_display_are_shown_wherever_the_game_runs(pair: Pair, bot: Bot) -> None:
    here, there = pair
    game = running(here)
    assert game is not None
    game.session.frames.violations += 1000
    game.session.frames.late_violations += 400

    def counted() -> Any:
        services = there.app.state.services
        ids, study = services.web.studies.versions("short"), services.web.studies.open("short")[1]
        return there.do(lambda: services.dashboard.of(ids, study, "active", True))["display"]

    await until(lambda: counted()["games"] == 1)
    assert counted()["timesteps"] >= 1000
    assert counted()["late"] >= 400
    await until(lambda: all(alerted(live, "did not show what the condition requires") for live in pair))
    assert all(alerted(live, "The server was too slow") for live in pair)


class Nobody:
    """A process without games."""

    def process(self, name: str) -> Process:
        return Process(name, {})

    def leases(self) -> list[str]:
        return []

    async def views(self) -> list[View]:
        return []

    async def run(self, command: Any) -> int:
        raise AssertionError(command)


async def test_a_process_can_leave_the_others_at_any_moment(own_redis: RedisServer) -> None:
    """Redis' client loses a cancellation that arrives just after a command was sent."""
    for moment in range(60):
        cluster = Cluster(own_redis.url, "postgresql://somewhere")
        cluster.start(Nobody())
        for _ in range(moment):
            await asyncio.sleep(0)
        leaving = asyncio.create_task(cluster.close())
        done, _ = await asyncio.wait([leaving], timeout=10)
        assert done, f"it hangs when told to after {moment} turns of the event loop"


def test_people_who_play_with_people_need_one_process(
    tmp_path: Path, postgres_pool: PostgresPool, own_redis: RedisServer
) -> None:
    study = PAIR_STUDY.replace(
        "{name: planner, predictor: sp_predictor_stream}", "{name: other, human: true, predictor: random}"
    )
    study = study.replace("conditions:", "order: {rule: fixed}\nconditions:")
    with postgres_pool.one() as address:
        live = LiveServer(tmp_path, study=study, database=address, redis=own_redis.url)
        with pytest.raises(StudyError, match="must reach the same process"):
            live.start()
