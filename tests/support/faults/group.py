"""Recording clients that play in parallel, and their study, which is one long game."""

import asyncio
import time
from typing import Any

from tests.support.faults.recording_client import ClientGame, LogEntry, RecordingClient
from tests.support.real_server import SHORT_STUDY

_ARMS = SHORT_STUDY.partition("conditions: ")[2].partition("\n")[0]
_PAUSES = "pause: {each_s: 3000, episode_s: 7200}"  # the limits run on the quick clock too
LONG_STUDY = (
    SHORT_STUDY.replace(_ARMS, "[{name: tom, predictor: tom}]")
    .replace(", {name: matrix, title: {en: Matrix}}", "")
    .replace("horizon: 60", f"horizon: 10000, {_PAUSES}")
    .replace("flow: [introduction, tutorial, episodes, thanks]", "flow: [introduction, episodes, thanks]")
)
SHORT_GAMES = LONG_STUDY.replace("horizon: 10000", "horizon: 40")


def moved(client: RecordingClient, after: float) -> LogEntry | None:
    """The first new timestep that the client was shown after a moment."""
    fresh = []
    for told in reversed(client.log.entries):
        if told.at <= after:
            break
        fresh.append(told)
    ticks = [told for told in reversed(fresh) if told.kind == "tick"]
    before = next((told for told in reversed(fresh) if told.kind == "welcome"), None)
    start = before.detail if before is not None else (ticks[0].detail if ticks else 0)
    return next((told for told in ticks if told.detail > start), None)


class ClientGroup:
    """`async with ClientGroup(url, 5) as group:` all of them are in a game that moves; the games end with the block."""

    def __init__(self, url: str, count: int, seed: int = 0, study: str = "short", **client: Any) -> None:
        self.clients = [RecordingClient(url, study, seed + number) for number in range(count)]
        for one in self.clients:
            for name, value in client.items():
                setattr(one, name, value)
        self._playing: list[asyncio.Task[Any]] = []
        self._games: list[ClientGame] = []

    async def __aenter__(self) -> "ClientGroup":
        await asyncio.gather(*(one.to_the_game() for one in self.clients))
        began = time.monotonic()
        self._games = [one.game() for one in self.clients]
        self._playing = [asyncio.create_task(game.play()) for game in self._games]
        await self.moving(began)
        return self

    async def __aexit__(self, *_: object) -> None:
        for task in self._playing:
            task.cancel()
        await asyncio.gather(*self._playing, return_exceptions=True)
        await asyncio.gather(*(one.close() for one in self.clients))

    async def moving(self, after: float, within_s: float = 60.0) -> list[float]:
        """Wait until every game has moved after a moment; how many seconds each took."""
        async with asyncio.timeout(within_s):
            while True:
                found = [moved(one, after) for one in self.clients]
                if all(found):
                    return [told.at - after for told in found if told is not None]
                for task in self._playing:
                    if task.done() and not task.cancelled():
                        task.result()
                await asyncio.sleep(0.02)

    async def told(self, kind: str, after: float, detail: Any = None, within_s: float = 30.0) -> list[float]:
        """Wait until everybody was told; how many seconds each took."""
        ends = time.monotonic() + within_s
        while True:
            found = [one.log.first(kind, after, detail) for one in self.clients]
            if all(found):
                return [told.at - after for told in found if told is not None]
            if time.monotonic() > ends:
                waiting = [one for one, told in zip(self.clients, found, strict=True) if told is None]
                last = [(told.kind, told.detail, round(told.at - after, 2)) for told in waiting[0].log.entries[-12:]]
                raise TimeoutError(f"{len(waiting)} were told no {kind!r}; the last that one of them was told: {last}")
            await asyncio.sleep(0.01)

    def since(self, kind: str, after: float) -> list[LogEntry]:
        return [told for one in self.clients for told in one.log.entries if told.kind == kind and told.at > after]
