"""How many games one server can run at once: bots on one core, the server on another, every tick committed.

Prints for each number of games: lateness of a tick, the share of ticks whose partner had to wait because its models
were late, CPU of the server and its model worker, memory and bytes per second of a game. Continues with more games
until ticks come too late or partners have to wait. Run it on a quiet machine: `python benchmarks/serve.py --json`.
"""

import argparse
import asyncio
import json
import os
import re
import signal
import sqlite3
import subprocess
import sys
import tempfile
import time
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np
from websockets.asyncio.client import ClientConnection, connect
from websockets.exceptions import ConnectionClosed

ROOT = Path(__file__).resolve().parent.parent
sys.path.insert(0, str(ROOT))

from benchmarks.processor import AVX2_ONLY  # noqa: E402
from benchmarks.support.process_cpu import cpu_s  # noqa: E402
from server.bots.participant import Bot  # noqa: E402

STUDY = """
name: load
title: {en: Load}
summary: {en: Nothing but games.}
languages: [en]
seed: 1
duration_min: 1
consent:
  title: {en: Load}
  lead: {en: Bots only.}
  sections: [{title: {en: Nothing}, body: {en: Nothing.}}]
  boxes: [{en: Yes.}]
conditions: [{name: tom, predictor: tom}]
agents: [{name: AGENT}]
layouts: [{name: coordination_ring, title: {en: Ring}}]
predictor: {form: FORM}
game: {horizon: 10000}
flow: [introduction, episodes, thanks]
"""


@dataclass
class ServeFigures:
    """One measurement; per game where the name says so."""

    games: int
    p50_ms: float
    p99_ms: float
    worst_ms: float
    cpu_per_game: float  # share of a core, server and model worker together
    server_cpu: float  # cores
    models_cpu: float  # cores
    mb_per_game: float
    bytes_per_s: float  # to one game's browser
    late_share: float  # of ticks whose partner had to wait
    unpredicted_share: float
    bots_cpu: float  # cores: near 1, the bots are what limits the games


class MeasuredServer:
    """`kitchenmind serve` on the given cores."""

    def __init__(self, folder: Path, arguments: argparse.Namespace) -> None:
        study = folder / "load.yaml"
        study.write_text(STUDY.replace("AGENT", arguments.agent).replace("FORM", arguments.form), encoding="utf-8")
        self.database = folder / "load.sqlite3"
        self.log = folder / "server.log"
        words = ["serve", "--port", "0", "--study", str(study)]
        words += ["--database", f"sqlite:///{self.database}"]
        with self.log.open("w") as log:
            self.process = subprocess.Popen(
                [sys.executable, str(ROOT / "kitchenmind"), *words],
                stdout=log,
                stderr=log,
                cwd=ROOT,
                env=os.environ | (AVX2_ONLY if arguments.avx2 else {}),
            )
        os.sched_setaffinity(self.process.pid, set(arguments.server_cores))
        while not (found := re.search(r"http://\S+:\d+", self.log.read_text())):
            if self.process.poll() is not None:
                raise SystemExit(self.log.read_text())
            time.sleep(0.1)
        self.url = found.group(0)

    def workers(self) -> list[int]:
        children = Path(f"/proc/{self.process.pid}/task/{self.process.pid}/children").read_text().split()
        return [int(child) for child in children]

    def rss_mb(self) -> float:
        status = Path(f"/proc/{self.process.pid}/status").read_text()
        return int(re.search(r"VmRSS:\s+(\d+)", status).group(1)) / 1024  # type: ignore[union-attr]


class LoadPlayer:
    """One light bot: it answers Pings, taps a key every other tick, and counts bytes."""

    def __init__(self, bot: Bot) -> None:
        self._bot = bot
        self.bytes = self.ticks = self.late = self.unpredicted = 0

    async def play(self) -> None:
        game = self._bot.game()
        headers = {"Cookie": game.cookie}
        async with connect(game.url, additional_headers=headers, compression=None, max_queue=64) as socket:
            await socket.send('{"type":"hello","protocol":1,"tab":"benchmark-1"}')
            await socket.send('{"type":"ready"}')
            try:
                while True:
                    await self._answer(socket, str(await socket.recv()))
            except ConnectionClosed:
                return

    async def _answer(self, socket: ClientConnection, frame: str) -> None:
        self.bytes += len(frame)
        if frame.startswith('{"type":"ping"'):
            await socket.send(frame.replace("ping", "pong"))
        elif frame.startswith('{"type":"tick"'):
            self.ticks += 1
            self.late += '"late":true' in frame
            self.unpredicted += '"prediction":[[6,' in frame
            if self.ticks % 2:
                tap = (0, 3, 5, 1, 2, 5)[self.ticks // 2 % 6]
                await socket.send(f'{{"type":"input","seq":{self.ticks},"held":null,"tap":{tap},"client_ms":1.0}}')


async def to_the_game(bot: Bot) -> None:
    """Go from the consent page to the game, without playing it."""
    page = await bot.consent()
    while not page.is_game:
        page = await bot.submit(page)


async def measure(server: MeasuredServer, players: list[LoadPlayer], window_s: float) -> ServeFigures:
    """Measure the next `window_s` seconds."""
    workers = server.workers()
    pids = (server.process.pid, *workers, os.getpid())
    before = [cpu_s(pid) for pid in pids]
    counts = [(player.bytes, player.ticks, player.late, player.unpredicted) for player in players]
    began = time.monotonic()
    await asyncio.sleep(window_s)
    took_s = time.monotonic() - began
    *used, bots = [(cpu_s(pid) - start) / took_s for pid, start in zip(pids, before, strict=True)]
    now = [(player.bytes, player.ticks, player.late, player.unpredicted) for player in players]
    byte_count, ticks, late, unpredicted = (
        sum(b[k] - a[k] for a, b in zip(counts, now, strict=True)) for k in range(4)
    )
    lateness = lateness_ms(server, int(window_s / 0.2) - 2)
    return ServeFigures(
        games=len(players),
        p50_ms=round(float(np.quantile(lateness, 0.5)), 2),
        p99_ms=round(float(np.quantile(lateness, 0.99)), 2),
        worst_ms=round(float(lateness.max()), 2),
        cpu_per_game=round(sum(used) / len(players), 5),
        server_cpu=round(used[0], 3),
        models_cpu=round(sum(used[1:]), 3),
        mb_per_game=0.0,
        bytes_per_s=round(byte_count / took_s / len(players)),
        late_share=round(late / max(1, ticks), 5),
        unpredicted_share=round(unpredicted / max(1, ticks), 5),
        bots_cpu=round(bots, 3),
    )


def lateness_ms(server: MeasuredServer, last: int) -> "np.ndarray[Any, np.dtype[np.float64]]":
    """Return the lateness of the last timesteps of every game, as stored."""
    with sqlite3.connect(f"file:{server.database}?mode=ro", uri=True) as database:
        rows = database.execute(
            "select late_ms from ticks join (select episode_id as e, max(timestep) as m from ticks group by episode_id)"
            " on e = episode_id where timestep > m - ? and timestep > 0",
            (last,),
        ).fetchall()
    return np.array([row[0] for row in rows])


async def run(arguments: argparse.Namespace) -> list[ServeFigures]:
    found: list[ServeFigures] = []
    with tempfile.TemporaryDirectory() as folder:
        server = MeasuredServer(Path(folder), arguments)
        players: list[LoadPlayer] = []
        tasks: list[asyncio.Task[None]] = []
        empty_mb = server.rss_mb()
        try:
            for games in arguments.games:
                await _fill(server, players, tasks, games)
                await asyncio.sleep(5)
                figures = await measure(server, players, arguments.window_s)
                figures.mb_per_game = round((server.rss_mb() - empty_mb) / games, 3)
                found.append(figures)
                print(json.dumps(asdict(figures)), file=sys.stderr)
                if figures.p99_ms > arguments.until_ms or figures.late_share > arguments.until_late_share:
                    break
        finally:
            for task in tasks:
                task.cancel()
            await asyncio.gather(*tasks, return_exceptions=True)
            server.process.send_signal(signal.SIGTERM)
            server.process.wait(30)
    return found


async def _fill(server: MeasuredServer, players: list[LoadPlayer], tasks: list[asyncio.Task[None]], games: int) -> None:
    while len(players) < games:
        bots = [Bot(server.url, "load", seed) for seed in range(len(players), min(games, len(players) + 10))]
        await asyncio.gather(*(to_the_game(bot) for bot in bots))
        for bot in bots:
            players.append(LoadPlayer(bot))
            tasks.append(asyncio.create_task(players[-1].play()))
            await bot.close()


def add_server_options(parser: argparse.ArgumentParser) -> None:
    """Add the options of a `MeasuredServer`, and the cores of its bots."""
    parser.add_argument("--agent", default="sp")
    parser.add_argument("--form", default="stream", choices=["window", "stream"])
    parser.add_argument("--server-cores", type=int, nargs="+", default=[1])
    parser.add_argument("--bot-cores", type=int, nargs="+", default=[0])
    parser.add_argument("--avx2", action="store_true", help="the server uses no AVX-512 instructions")


def main() -> None:
    parser = argparse.ArgumentParser(allow_abbrev=False, description=__doc__)
    parser.add_argument("--games", type=int, nargs="+", default=[1, 50, 100, 200, 300, 400, 500, 600, 700])
    parser.add_argument("--window-s", type=float, default=15.0)
    parser.add_argument("--until-ms", type=float, default=20.0, help="stop above this p99 lateness")
    parser.add_argument("--until-late-share", type=float, default=0.001, help="stop above this share of late partners")
    add_server_options(parser)
    parser.add_argument("--json", action="store_true", help="print one list for programs")
    arguments = parser.parse_args()
    os.sched_setaffinity(0, set(arguments.bot_cores))
    found = asyncio.run(run(arguments))
    if arguments.json:
        print(json.dumps([asdict(figures) for figures in found]))


if __name__ == "__main__":
    main()
