"""What researchers see of a round of two people: who of them needs attention."""

from dataclasses import replace
from types import SimpleNamespace
from typing import Any, cast

import pytest

from server.monitoring.live_games import LiveGames, card_of, who
from server.play import messages as m
from server.play.game import Game
from server.play.pause_reasons import RESEARCHER
from server.store.overview import Played
from tests.support.live_fakes import QuietConnection, make_spec
from tests.support.running_games import RunningGames, running, until

__all__ = ["running"]
_NOTHING: Any = None
FIRST = Played(
    "e1", 1, "p1", 1, simulated=False, condition="tom", seed=1, kind="episode", episode=1, agent="human",
    layout="ring", shown="nothing", misleading=False, seat=0, status="running", end_reason=None, score=None,
    started_at=None, ended_at=None, paused_by=None,
)  # fmt: skip
SECOND = replace(FIRST, participant_id="p2", number=2, seat=1)


@pytest.fixture
def live(running: RunningGames) -> LiveGames:
    running.specs["e1"] = make_spec(agents=(None, None), horizon=4000)

    async def read(*_: object) -> dict[str, tuple[Played, ...]]:
        return {"e1": (FIRST, SECOND)}

    sockets = SimpleNamespace(rtts_ms=lambda: {"p1": 20.0, "p2": 40.0})
    web = SimpleNamespace(database=SimpleNamespace(read=read))
    return LiveGames(cast(Any, web), running.games, cast(Any, sockets))


async def played_by_two(running: RunningGames) -> tuple[Game, list[QuietConnection]]:
    connections = [QuietConnection("tab-0001"), QuietConnection("tab-0002")]
    for seat, connection in enumerate(connections):
        game = await running.games.join("e1", seat, connection)
    for seat, connection in enumerate(connections):
        game.receive(seat, connection, m.Ready())
    await until(lambda: running.ticks() > 3)
    return game, connections


@pytest.mark.parametrize(("seat", "label"), [(0, "P-001"), (1, "P-002")])
async def test_the_card_names_the_person_who_is_gone(
    running: RunningGames, live: LiveGames, seat: int, label: str
) -> None:
    game, connections = await played_by_two(running)
    game.leave(seat, connections[seat])
    (card,) = await live.cards((1,))
    assert (who(card.played), card.flag.word) == (label, "Disconnected")
    assert card_of(live, card, {})["people"] == ["p1", "p2"]


async def test_the_card_names_the_person_whose_tab_is_hidden(running: RunningGames, live: LiveGames) -> None:
    game, connections = await played_by_two(running)
    game.receive(1, connections[1], m.Away("hidden"))
    (card,) = await live.cards((1,))
    assert (who(card.played), card.flag.word, card.rtt_ms) == ("P-002", "Hidden tab", 40.0)


async def test_a_game_that_is_paused_before_its_start_is_shown_as_paused(
    running: RunningGames, live: LiveGames
) -> None:
    game = await running.games.join("e1", 0, QuietConnection())
    game.pause(RESEARCHER, "researcher")
    (card,) = await live.cards((1,))
    assert card.flag.word == "Paused"


async def test_a_person_who_is_back_is_not_away_while_a_researcher_pauses_the_game(
    running: RunningGames, live: LiveGames
) -> None:
    game, connections = await played_by_two(running)
    game.receive(1, connections[1], m.Away("hidden"))
    game.pause(RESEARCHER, "researcher")
    game.receive(1, connections[1], m.Ready())
    (card,) = await live.cards((1,))
    assert card.flag.word == "Paused"
