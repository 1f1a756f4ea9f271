"""Inputs of a paused game are stored during the pause: a server that is killed then loses none of them."""

import asyncio
from collections.abc import Sequence

from overcooked.constants import EAST, NORTH
from server.play import messages as m
from server.play.recorder import InputRecord, RecorderDown
from tests.support.live_fakes import QuietConnection, make_spec
from tests.support.running_games import RunningGames, until


def outcomes(running: RunningGames) -> list[tuple[int, str]]:
    return [(record.seq, record.outcome) for record in running.recorder.inputs_of.get("e1", [])]


async def test_taps_during_a_pause_are_stored_before_it_ends(running: RunningGames) -> None:
    running.specs["e1"] = make_spec(horizon=400)  # not over before the pause, on a busy machine either
    connection = await running.play()
    game = running.games.get("e1")
    assert game is not None
    await until(lambda: running.ticks() > 3)
    game.receive(0, connection, m.Away("blur"))
    await until(lambda: not game.busy)
    game.receive(0, connection, m.Input(0, None, EAST, 1.0))
    game.receive(0, connection, m.Input(0, None, EAST, 1.0))
    await until(lambda: len(outcomes(running)) == 2)
    assert game.session.phase == "paused"
    assert outcomes(running) == [(0, "stood_still"), (0, "repeated")]


async def test_taps_before_the_start_are_stored_too_and_none_twice(running: RunningGames) -> None:
    connection = QuietConnection()
    game = await running.games.join("e1", 0, connection)
    game.receive(0, connection, m.Input(0, None, NORTH, 1.0))
    await until(lambda: outcomes(running) == [(0, "stood_still")])
    game.receive(0, connection, m.Ready())
    await until(lambda: connection.closed)
    with_ticks = [record for tick in running.recorder.ticks_of["e1"].values() for record in tick.inputs]
    assert with_ticks == []
    assert outcomes(running) == [(0, "stood_still")]


async def test_inputs_wait_for_an_unavailable_database(running: RunningGames) -> None:
    connection = QuietConnection()
    game = await running.games.join("e1", 0, connection)
    refused = asyncio.Event()
    take = running.recorder.inputs

    async def refuse(episode: str, records: Sequence[InputRecord]) -> None:
        running.recorder.inputs = take  # type: ignore[method-assign]
        refused.set()
        raise RecorderDown("not now")

    running.recorder.inputs = refuse  # type: ignore[method-assign]
    game.receive(0, connection, m.Input(0, None, NORTH, 1.0))
    await asyncio.wait_for(refused.wait(), 10)
    await until(lambda: outcomes(running) == [(0, "stood_still")])
