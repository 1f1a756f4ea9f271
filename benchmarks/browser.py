"""Rendering cost of the game in the browser: frames per second and script time, with the CPU slowed down 4x.

`python benchmarks/browser.py [--seconds N] [--json]`: Chromium without a GPU plays Double Rings at 5 ticks a second,
once for each thing a participant may see: the predictor's marks, random marks, nothing.
"""

import argparse
import contextlib
import json
import random
import statistics
import sys
import threading
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from playwright.sync_api import Browser, Page, ViewportSize, sync_playwright
from websockets.exceptions import ConnectionClosed

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT))

from server.play.messages import Countdown, Ready  # noqa: E402
from tests.support.browser.chromium import CHROMIUM_ARGUMENTS, installed_chromium  # noqa: E402
from tests.support.browser.fake_game_server import NONE, RINGS, FakeGameServer, kitchen, tick, welcome  # noqa: E402

SLOWDOWN = 4
TARGET_FPS = 55
OPACITIES = (95, 80, 60)
ROUND = [(x, 1) for x in range(1, 8)] + [(7, 2)] + [(x, 3) for x in range(7, 0, -1)] + [(1, 2)]

# The time between two frames, in ms.
WATCH = """() => { window.pictures = []; let last = performance.now();
  const next = (now) => { window.pictures.push(now - last); last = now; requestAnimationFrame(next); };
  requestAnimationFrame(next); }"""


def prediction(shown: str, chance: random.Random, t: int) -> tuple[tuple[int, int], ...]:
    if shown == "nothing":
        return NONE
    if shown == "random":
        return tuple((chance.randrange(6), opacity) for opacity in OPACITIES)
    return tuple((heading(t + step), opacity) for step, opacity in enumerate(OPACITIES))


def heading(t: int) -> int:
    """Return the direction of a chef that walks round the outer ring."""
    (x, y), (next_x, next_y) = (ROUND[(t + step) % len(ROUND)] for step in (0, 1))
    return {(0, -1): 0, (0, 1): 1, (1, 0): 2, (-1, 0): 3}[(next_x - x, next_y - y)]


def state(t: int) -> Any:
    """Return a state in which both chefs walk round, one pot cooks and one is ready, so that every frame changes."""
    partner, human = ROUND[t % len(ROUND)], ROUND[(t + 8) % len(ROUND)]
    players = ((*human, heading(t + 8), 1), (*partner, heading(t), 3))
    counters = ((6, 2, 2), (4, 4, 1), (2, 2, 3), (3, 2, 1))
    return kitchen(t=t, players=players, counters=counters, pots=((4, 0, 3, t % 20), (6, 0, 3, 20)))


@contextlib.contextmanager
def game_page(chromium: Browser, shown: str, size: ViewportSize) -> Iterator[Page]:
    """Yield a page with a game that runs until the block ends."""
    server = FakeGameServer()
    server.welcome = welcome(grid=RINGS, state=state(0), shows_predictions=shown != "nothing")
    page = chromium.new_page(viewport=size)
    page.goto(server.url)
    page.click("#start-button")
    server.wait_for(lambda server: bool(server.of(Ready)))
    server.send(Countdown(0))
    stop = threading.Event()
    player = threading.Thread(target=play, args=(server, shown, stop))
    player.start()
    yield page
    stop.set()
    player.join()
    page.close()
    server.close()


def measure(chromium: Browser, shown: str, seconds: float) -> dict[str, Any]:
    """Measure one game of this many seconds."""
    with game_page(chromium, shown, {"width": 1366, "height": 768}) as page:
        devtools = page.context.new_cdp_session(page)
        devtools.send("Emulation.setCPUThrottlingRate", {"rate": SLOWDOWN})
        devtools.send("Performance.enable")
        page.evaluate(WATCH)
        page.wait_for_timeout(1000)
        page.evaluate("window.pictures.length = 0")
        before = metrics(devtools)
        page.wait_for_timeout(seconds * 1000)
        after = metrics(devtools)
        gaps = page.evaluate("window.pictures")
    return {
        "shown": shown,
        "slowdown": SLOWDOWN,
        "fps": round(1000 * len(gaps) / sum(gaps), 1),
        "p95_gap_ms": round(statistics.quantiles(gaps, n=20)[-1], 1),
        "script_ms_per_picture": round((after["ScriptDuration"] - before["ScriptDuration"]) * 1000 / len(gaps), 2),
        "task_ms_per_picture": round((after["TaskDuration"] - before["TaskDuration"]) * 1000 / len(gaps), 2),
    }


def metrics(devtools: Any) -> dict[str, float]:
    return {each["name"]: each["value"] for each in devtools.send("Performance.getMetrics")["metrics"]}


def play(server: FakeGameServer, shown: str, stop: threading.Event) -> None:
    chance = random.Random(1)
    begin = time.monotonic()
    for t in range(1, 100_000):
        with contextlib.suppress(ConnectionClosed):
            server.send(tick(state(t), prediction(shown, chance, t), actions=(heading(t + 7), heading(t - 1))))
        if stop.wait(max(0.0, begin + t * 0.2 - time.monotonic())):
            return


def main() -> int:
    """Return exit status 1 if a condition is drawn at less than TARGET_FPS."""
    parser = argparse.ArgumentParser(allow_abbrev=False, description=__doc__)
    parser.add_argument("--seconds", type=float, default=10)
    parser.add_argument("--json", action="store_true")
    arguments = parser.parse_args()
    executable = installed_chromium()
    with sync_playwright() as playwright:
        chromium = playwright.chromium.launch(executable_path=executable, args=CHROMIUM_ARGUMENTS)
        rows = [measure(chromium, shown, arguments.seconds) for shown in ("predictor", "random", "nothing")]
        chromium.close()
    if arguments.json:
        print(json.dumps(rows))
    else:
        for row in rows:
            print("  ".join(f"{name} {value}" for name, value in row.items()))
    slow = [str(row["shown"]) for row in rows if row["fps"] < TARGET_FPS]
    if slow:
        print(f"fewer than {TARGET_FPS} frames a second: {', '.join(slow)}. Is the machine busy?", file=sys.stderr)
    return 1 if slow else 0


if __name__ == "__main__":
    sys.exit(main())
