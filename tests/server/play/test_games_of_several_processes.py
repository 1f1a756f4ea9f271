"""Games that another process takes up, and that come back, while this one still has something to do about them."""

import asyncio

import pytest

from server.play.games import Games
from server.play.recorder import EpisodeResult, GamesLost
from tests.support.live_fakes import QuietConnection
from tests.support.running_games import RunningGames, until


class FakeOwners:
    """Says at a moment of the test's choice that a game is still this process's."""

    def __init__(self) -> None:
        self.may_answer = asyncio.Event()

    async def still_mine(self, episode: str) -> bool:
        await self.may_answer.wait()
        return True

    def let_go(self, episode: str) -> None: ...


@pytest.fixture
def owners(running: RunningGames) -> FakeOwners:
    made = FakeOwners()
    running.games = Games(running.games.clock, running.models, running.recorder, running.load, owners=made)
    return made


async def test_a_game_that_goes_while_its_owner_is_asked_for_is_taken_up_again(
    running: RunningGames, owners: FakeOwners
) -> None:
    old = await running.games.join("e1", 0, QuietConnection())
    joining = asyncio.create_task(running.games.join("e1", 0, QuietConnection()))
    await asyncio.sleep(0)
    running.games.let_go(old)
    owners.may_answer.set()
    joined = await joining
    assert joined is not old
    assert running.games.get("e1") is joined


async def test_the_late_end_of_a_game_that_was_lost_leaves_the_one_that_is_played_now(
    running: RunningGames, owners: FakeOwners, monkeypatch: pytest.MonkeyPatch
) -> None:
    owners.may_answer.set()
    ends, may_end = [], asyncio.Event()

    async def too_late(result: EpisodeResult) -> None:
        await may_end.wait()
        ends.append(result)
        raise GamesLost({result.episode})

    monkeypatch.setattr(running.recorder, "end", too_late)
    old = await running.games.join("e1", 0, QuietConnection())
    running.games.abort(old, "away")
    running.games.let_go(old)
    again = await running.games.join("e1", 0, QuietConnection())
    may_end.set()
    await until(lambda: ends)
    await asyncio.sleep(0.01)
    assert running.games.get("e1") is again
