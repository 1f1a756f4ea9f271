"""Games in memory against a fast clock, without a browser or a database."""

import asyncio
from collections.abc import AsyncIterator, Callable
from dataclasses import replace

import pytest

from server.play import messages as m
from server.play.clock import Clock
from server.play.episode_spec import EpisodeSpec
from server.play.game import Game
from server.play.games import Games
from server.play.recorder import EpisodeRecord
from tests.support.live_fakes import MemoryRecorder, QuietConnection, RuleModels, make_spec

SPEED = 20.0


class RunningGames:
    """Games with their surroundings; `specs` by episode."""

    def __init__(self, speed: float = SPEED) -> None:
        self.recorder, self.models = MemoryRecorder(), RuleModels()
        self.specs: dict[str, EpisodeSpec] = {"e1": make_spec()}
        self.games = Games(Clock(speed), self.models, self.recorder, self.load)

    async def load(self, episode: str) -> EpisodeRecord | None:
        if episode not in self.specs:
            return None
        record = self.recorder.load(self.specs[episode], episode)
        result = self.recorder.results.get(episode)
        return record if result is None else replace(record, status=result.status)

    async def play(self, episode: str = "e1", tab: str = "tab-0001") -> QuietConnection:
        connection = QuietConnection(tab)
        game = await self.games.join(episode, 0, connection)
        game.receive(0, connection, m.Ready())
        return connection

    async def under_way(self) -> tuple[QuietConnection, Game]:
        """Play the first episode for a few timesteps."""
        connection = await self.play()
        await until(lambda: self.ticks() > 3)
        game = self.games.get("e1")
        assert game is not None
        return connection, game

    def ticks(self, episode: str = "e1") -> int:
        return len(self.recorder.ticks_of.get(episode, {}))


@pytest.fixture
async def running() -> AsyncIterator[RunningGames]:
    made = RunningGames()
    yield made
    await made.games.stop()


async def until(condition: Callable[[], object], within_s: float = 10.0) -> None:
    async with asyncio.timeout(within_s):
        while not condition():
            await asyncio.sleep(0.002)
