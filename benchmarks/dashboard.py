"""The cost and speed of the researcher's live page with many games: bots on one core, the server on another.

`python benchmarks/dashboard.py [--games 200] [--json]`: first paint of the page, until all cards are there, how far its
boards are behind the games, CPU of the browser, and how an open page affects the lateness of ticks (windows with and
without an open page alternate). Run it on a quiet machine.
"""

import argparse
import asyncio
import json
import os
import re
import subprocess
import sys
import tempfile
import time
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np
from playwright.async_api import Browser, Page, async_playwright
from websockets.asyncio.client import ClientConnection

ROOT = Path(__file__).resolve().parent.parent
sys.path.insert(0, str(ROOT))

from benchmarks.serve import LoadPlayer, MeasuredServer, add_server_options, cpu_s, lateness_ms, to_the_game  # noqa: E402
from server.bots.participant import Bot  # noqa: E402
from tests.support.browser.chromium import CHROMIUM_ARGUMENTS, installed_chromium  # noqa: E402

_EPISODE = re.compile(r'"episode":"([^"]+)"')
_TIMESTEP = re.compile(r'"state":\{"t":(\d+)')
# The episode and timestep that every card in view shows now.
_SHOWN = """(horizon) => [...document.querySelectorAll('#boards li[data-in-view=yes]')]
  .map((item) => [item.dataset.episode, Math.round(item.querySelector('progress').value * horizon)])"""
_PAINT = "() => performance.getEntriesByName('first-contentful-paint')[0].startTime"
_HORIZON = 10_000


@dataclass
class DashboardFigures:
    """Times in ms; lateness is that of the ticks as stored."""

    games: int
    first_paint_ms: float
    all_cards_ms: float
    behind_p50_ms: float
    behind_p99_ms: float
    browser_cpu: float  # cores
    p99_alone_ms: float
    p99_watched_ms: float

    @property
    def moved_ms(self) -> float:
        return round(self.p99_watched_ms - self.p99_alone_ms, 2)


class WatchedGame(LoadPlayer):
    """A light bot that records when each timestep arrived."""

    def __init__(self, bot: Bot) -> None:
        super().__init__(bot)
        self.episode = ""
        self.seen: dict[int, float] = {}

    async def _answer(self, socket: ClientConnection, frame: str) -> None:
        if frame.startswith('{"type":"tick"') and (found := _TIMESTEP.search(frame)):
            self.seen[int(found.group(1))] = time.monotonic()
        elif not self.episode and (found := _EPISODE.search(frame)):
            self.episode = found.group(1)
        await super()._answer(socket, frame)


def account(server: MeasuredServer) -> str:
    """Create a researcher; return the password."""
    words = ["admin", "--database", f"sqlite:///{server.database}", "create", "mara", "--role", "act"]
    line = [sys.executable, str(ROOT / "kitchenmind"), *words]
    made = subprocess.run(line, capture_output=True, text=True, check=True, stdin=subprocess.DEVNULL)
    return re.search(r"password: (\S+)", made.stdout).group(1)  # type: ignore[union-attr]


async def sign_in(browser: Browser, url: str, password: str) -> Page:
    page = await browser.new_page(viewport={"width": 1366, "height": 768})
    await page.goto(f"{url}/admin")
    await page.fill("[name=name]", "mara")
    await page.fill("[name=password]", password)
    await page.click("form button")
    await page.wait_for_url("**/admin")
    return page


async def open_page(page: Page, url: str, games: int) -> tuple[float, float]:
    """Measure the first paint, and the time until every game has its card."""
    began = time.monotonic()
    await page.goto(f"{url}/admin/s/load", wait_until="commit")
    while await page.locator("#boards li").count() < games:
        await asyncio.sleep(0.02)
    cards_ms = 1000 * (time.monotonic() - began)
    return float(await page.evaluate(_PAINT)), cards_ms


async def behind(page: Page, players: list[WatchedGame], window_s: float) -> list[float]:
    """Return how long ago the timestep after the one shown had reached its player, for every card in view; 0:
    newest."""
    by_episode = {player.episode: player for player in players}
    found: list[float] = []
    until = time.monotonic() + window_s
    while time.monotonic() < until:
        now = time.monotonic()
        for episode, timestep in await page.evaluate(_SHOWN, _HORIZON):
            next_seen = by_episode[episode].seen.get(timestep + 1, now)
            found.append(max(0.0, 1000 * (now - next_seen)))
        await asyncio.sleep(0.11)
    return found


def descendants(pid: int) -> list[int]:
    """Return all processes below this one."""
    found = []
    for child in Path(f"/proc/{pid}/task/{pid}/children").read_text().split():
        found += [int(child), *descendants(int(child))]
    return found


def browser_cpu_s() -> float:
    total = 0.0
    for pid in descendants(os.getpid()):
        try:
            if b"chromium" in Path(f"/proc/{pid}/cmdline").read_bytes():
                total += cpu_s(pid)
        except OSError:
            continue
    return total


async def fill(server: MeasuredServer, games: int) -> tuple[list[WatchedGame], list[asyncio.Task[None]]]:
    players: list[WatchedGame] = []
    tasks: list[asyncio.Task[None]] = []
    while len(players) < games:
        bots = [Bot(server.url, "load", seed) for seed in range(len(players), min(games, len(players) + 10))]
        await asyncio.gather(*(to_the_game(bot) for bot in bots))
        for bot in bots:
            players.append(WatchedGame(bot))
            tasks.append(asyncio.create_task(players[-1].play()))
            await bot.close()
    return players, tasks


async def run(arguments: argparse.Namespace) -> DashboardFigures:
    with tempfile.TemporaryDirectory() as folder:
        server = MeasuredServer(Path(folder), arguments)
        password = account(server)
        players, tasks = await fill(server, arguments.games)
        try:
            async with async_playwright() as playwright:
                path = arguments.chromium
                browser = await playwright.chromium.launch(executable_path=path, args=CHROMIUM_ARGUMENTS)
                page = await sign_in(browser, server.url, password)
                return await watch(server, page, players, arguments)
        finally:
            for task in tasks:
                task.cancel()
            await asyncio.gather(*tasks, return_exceptions=True)
            server.process.terminate()
            server.process.wait(30)


async def watch(
    server: MeasuredServer, page: Page, players: list[WatchedGame], arguments: argparse.Namespace
) -> DashboardFigures:
    """Alternate windows without and with an open page."""
    alone: list[Any] = []
    watched: list[Any] = []
    late: list[float] = []
    cpu = 0.0
    ticks = int(arguments.window_s / 0.2) - 5
    for _ in range(arguments.turns):
        await page.goto("about:blank")
        await asyncio.sleep(arguments.window_s + 1)
        alone.append(lateness_ms(server, ticks))
        paint_ms, cards_ms = await open_page(page, server.url, arguments.games)
        await asyncio.sleep(2)
        before = browser_cpu_s()
        late += await behind(page, players, arguments.window_s)
        cpu += (browser_cpu_s() - before) / arguments.window_s
        watched.append(lateness_ms(server, ticks))
    p99 = [float(np.quantile(np.concatenate(windows), 0.99)) for windows in (alone, watched)]
    return DashboardFigures(
        games=arguments.games,
        first_paint_ms=round(paint_ms),
        all_cards_ms=round(cards_ms),
        behind_p50_ms=round(float(np.quantile(late, 0.5))),
        behind_p99_ms=round(float(np.quantile(late, 0.99))),
        browser_cpu=round(cpu / arguments.turns, 2),
        p99_alone_ms=round(p99[0], 2),
        p99_watched_ms=round(p99[1], 2),
    )


def main() -> None:
    parser = argparse.ArgumentParser(
        allow_abbrev=False, description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--games", type=int, default=200)
    parser.add_argument("--window-s", type=float, default=12.0)
    parser.add_argument("--turns", type=int, default=3, help="windows with and without an open page")
    parser.add_argument("--chromium", default=installed_chromium())
    add_server_options(parser)
    parser.add_argument("--json", action="store_true")
    arguments = parser.parse_args()
    os.sched_setaffinity(0, set(arguments.bot_cores))
    figures = asyncio.run(run(arguments))
    found = asdict(figures) | {"moved_ms": figures.moved_ms}
    print(json.dumps(found) if arguments.json else "\n".join(f"{name:<16} {value}" for name, value in found.items()))


if __name__ == "__main__":
    main()
