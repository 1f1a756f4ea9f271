"""Faults of the connection between browser and server (rows 9 to 12, 16, 17), caused in the real application."""

import asyncio
import json
import random
import time
from itertools import pairwise
from pathlib import Path
from typing import Any

from websockets.asyncio.client import ClientConnection

from server.play import messages, send_queue
from tests.support.faults.fault_proxy import FaultProxy, Weather
from tests.support.faults.fault_scenario import FaultResult, rounded
from tests.support.faults.group import LONG_STUDY, ClientGroup
from tests.support.faults.invariants import Holdings, held_against, lateness_ms, longest, p99
from tests.support.faults.recording_client import ClientGame, RecordingClient
from tests.support.live_server import LiveServer

ROUGH = Weather(latency_ms=100, jitter_ms=50, loss=0.02)  # each way: 200 ms +- 100 there and back
GOAL_HALF_OPEN_S = 6.0
SLOW_CLIENT_KIB = 256


async def hard_resets(folder: Path, tries: int, games: int = 3, seed: int = 0) -> FaultResult:
    """Row 11: every connection is reset again and again; games come back at their timestep without a reload."""
    with LiveServer(folder, study=LONG_STUDY) as live:
        async with FaultProxy(live.port, seed) as proxy, ClientGroup(proxy.url, games, seed) as group:
            took = []
            for _ in range(tries):
                await asyncio.sleep(random.Random(seed).uniform(0.1, 0.4))
                broken = time.monotonic()
                proxy.reset()
                took += await group.moving(broken)
        found = held_against(live.database, group.clients)
    figure = found.figures() | {"back_p99_s": rounded(p99(took)), "back_most_s": rounded(max(took))}
    return FaultResult(11, "hard reset", tries * games, found.ok and found.compared > 0, figure)


async def half_open(folder: Path, tries: int, seed: int = 0) -> FaultResult:
    """Row 10: bytes vanish in both directions and nobody is told; the server notices and the seat is free."""
    took: list[float] = []
    ghosts = 0
    with LiveServer(folder, study=LONG_STUDY) as live:
        for number in range(tries):
            async with FaultProxy(live.port, seed + number) as proxy:
                group = ClientGroup(proxy.url, 1, seed + number)
                async with group:
                    silent = time.monotonic()
                    proxy.deaf = True
                    while len(live.app.state.services.sockets) and time.monotonic() - silent < 10:
                        await asyncio.sleep(0.02)
                    took.append(time.monotonic() - silent)
                    ghosts += len(live.app.state.services.sockets)
    figure = {"noticed_most_s": rounded(max(took)), "ghosts": ghosts, "goal_s": GOAL_HALF_OPEN_S}
    return FaultResult(10, "half-open connection", tries, not ghosts and max(took) <= GOAL_HALF_OPEN_S, figure)


async def reconnects(folder: Path, tries: int) -> FaultResult:
    """Row 12: one participant reconnects again and again; no connection or descriptor is left, and there is one row and
    one seat."""
    with LiveServer(folder, study=LONG_STUDY) as live:
        client = RecordingClient(live.url, "short", 1)
        await client.to_the_game()
        game = client.game()
        for _ in range(10):
            await _visit(game)
        before = await _settled(live)
        for _ in range(tries):
            await _visit(game)
            await asyncio.sleep(0.005)  # two hundred messages a second are allowed at this speed of the clock
        after = await _settled(live)
        await client.close()
        found = held_against(live.database, [client])
        left = after.sockets - before.sockets  # files may grow: the database opens a reader more when it needs one
        figure = found.figures() | {"descriptors_left": left, "ghosts": len(live.app.state.services.sockets)}
        figure["rss_growth_kib"] = after.rss_kib - before.rss_kib
        passed = found.ok and left <= 0 and not figure["ghosts"] and len(live.app.state.services.games) == 1
    return FaultResult(12, "reconnects of one participant", tries, passed, figure)


async def herd(folder: Path, people: int) -> FaultResult:
    """Row 12: all connections break at one instant and all come back at once."""
    with LiveServer(folder, study=LONG_STUDY, speed=1.0) as live:
        async with FaultProxy(live.port) as proxy, ClientGroup(proxy.url, people, idle=0.95) as group:
            for _ in range(2):
                broken = time.monotonic()
                proxy.reset()
                took = await group.told("welcome", broken, within_s=60)
            await group.moving(time.monotonic())
        found = held_against(live.database, group.clients, silence_s=10)
        ghosts = await _ghosts(live)
    figure = found.figures() | {"back_p99_s": rounded(p99(took)), "ghosts": ghosts}
    return FaultResult(12, "everybody reconnects at once", people, found.ok and not ghosts, figure)


async def _visit(game: ClientGame) -> None:
    async with game.connect() as socket:
        await socket.send(json.dumps({"type": "hello", "protocol": 1, "tab": game.tab}))
        while '"welcome"' not in str(await socket.recv()):
            pass


async def _ghosts(live: LiveServer) -> int:
    for _ in range(100):
        if not len(live.app.state.services.sockets):
            break
        await asyncio.sleep(0.05)
    return len(live.app.state.services.sockets)


async def _settled(live: LiveServer) -> Holdings:
    import os

    await _ghosts(live)
    await asyncio.sleep(0.2)
    return Holdings.of(os.getpid())


async def slow_reader(folder: Path, seconds: float) -> FaultResult:
    """Row 9: one browser reads 1 kB a second, another nothing; queues stay short and the other games are on time."""
    with LiveServer(folder, study=LONG_STUDY, speed=1.0) as live:
        async with (
            FaultProxy(live.port) as proxy,
            ClientGroup(live.url, 3) as others,
            ClientGroup(proxy.url, 1, 50) as slow,
        ):
            before = await _settled_now()
            proxy.weather = Weather(bytes_per_s=1000)
            waiting, ends = 0, time.monotonic() + seconds
            while time.monotonic() < ends:
                await asyncio.sleep(0.05)
                waiting = max(
                    [waiting, *(len(one.send_queue._line) for one in list(live.app.state.services.sockets._open))]
                )
            slow_growth = (await _settled_now()).rss_kib - before.rss_kib
            await others.moving(time.monotonic())
        calm = {episode for one in others.clients for episode, _ in one.log.states}
        late = p99(lateness_ms(live.database, calm))
        found = held_against(live.database, [*others.clients, *slow.clients], silence_s=seconds + 10)
    figure = found.figures() | {"queue_most": waiting, "rss_growth_kib": slow_growth, "others_p99_ms": rounded(late)}
    passed = found.ok and waiting <= send_queue._MAX_WAITING + 1 and slow_growth < 4 * SLOW_CLIENT_KIB
    return FaultResult(9, "slow reader", 1, passed, figure)


async def _settled_now() -> Holdings:
    import os

    return Holdings.of(os.getpid())


async def rough_weather(folder: Path, seconds: float, games: int = 3, seed: int = 0) -> FaultResult:
    """Row 16: 200 ms +- 100 and 2 % loss; the server's clock does not notice, and frames come in order."""
    with LiveServer(folder, study=LONG_STUDY, speed=1.0) as live:
        async with FaultProxy(live.port, seed, ROUGH) as proxy, ClientGroup(proxy.url, games, seed) as group:
            await asyncio.sleep(seconds)
            await group.moving(time.monotonic())
        found = held_against(live.database, group.clients, silence_s=10)
        late = lateness_ms(live.database)
    back = [one for client in group.clients for one in _backwards(client)]
    figure = found.figures() | {"late_p99_ms": rounded(p99(late)), "frames_back_in_time": len(back)}
    return FaultResult(16, "latency, jitter and loss", games, found.ok and not back, figure)


def _backwards(client: RecordingClient) -> list[int]:
    ticks = [told.detail for told in client.log.entries if told.kind == "tick"]
    return [later for earlier, later in pairwise(ticks) if later < earlier]


class Stutterer(ClientGame):
    """Sends every input twice, some of them late, and old ones again."""

    async def act(self, socket: ClientConnection) -> None:
        before = len(self.log.inputs)
        await super().act(socket)
        if len(self.log.inputs) > before:
            sent = [messages.Input(seq, None, tap, float(seq)) for _, seq, tap in self.log.inputs[-4:]]
            for message in [sent[-1], *self.chance.sample(sent, len(sent))]:
                await self.say(socket, message)


async def stutter(folder: Path, seconds: float, games: int = 2) -> FaultResult:
    """Row 17: inputs come twice, in the wrong order and again later; each moves once."""
    with LiveServer(folder, study=LONG_STUDY, speed=2.0) as live:
        async with ClientGroup(live.url, games, game_type=Stutterer, idle=0.7) as group:
            await asyncio.sleep(seconds)
        found = held_against(live.database, group.clients)
    sent = sum(len(one.log.inputs) for one in group.clients)
    figure = found.figures() | {"inputs": sent}
    return FaultResult(17, "duplicated, reordered and replayed inputs", sent, found.ok and sent > 0, figure)


async def frozen_ways(folder: Path, up: bool, down: bool, seconds: float) -> FaultResult:
    """Row 10: one direction stands still for a while, the other continues."""
    with LiveServer(folder, study=LONG_STUDY) as live:
        async with FaultProxy(live.port) as proxy, ClientGroup(proxy.url, 2) as group:
            proxy.freeze(up, down)
            await asyncio.sleep(seconds)
            proxy.thaw()
            took = await group.moving(time.monotonic())
        found = held_against(live.database, group.clients, silence_s=seconds + 5)
    names: dict[tuple[bool, bool], str] = {(True, False): "up", (False, True): "down", (True, True): "both ways"}
    figure: dict[str, Any] = found.figures() | {"back_most_s": rounded(longest(took))}
    return FaultResult(10, f"line frozen {names[up, down]} for {seconds:g} s", 2, found.ok, figure)
