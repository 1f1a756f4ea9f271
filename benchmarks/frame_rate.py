"""Frames per second of the game at 1920 x 1080 without a GPU, and the CPU time of a frame.

`python benchmarks/frame_rate.py [--seconds N] [--against REVISION] [--json]`: Chromium draws the game of
`benchmarks/browser.py` in software, with the predictor's marks. `--against` measures the pages of another revision in
turn with these. On a busy machine the frame rate falls; the CPU time of a frame changes less.
"""

import argparse
import json
import os
import shutil
import statistics
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Any

from playwright.sync_api import Browser, ViewportSize, sync_playwright

# The checkout whose pages are drawn: a revision is measured by a separate process.
ROOT = Path(os.environ.get("PICTURES_OF") or Path(__file__).resolve().parents[1])
sys.path.insert(0, str(ROOT))

from benchmarks import browser as game  # noqa: E402
from benchmarks.processor import described  # noqa: E402
from tests.support.browser.chromium import CHROMIUM_ARGUMENTS, installed_chromium  # noqa: E402

SIZE: ViewportSize = {"width": 1920, "height": 1080}
TURNS = 3  # of each revision


def measured(seconds: float) -> dict[str, float]:
    """Measure one game with the pages in ROOT."""
    with sync_playwright() as playwright:
        executable = installed_chromium()
        chromium = playwright.chromium.launch(executable_path=executable, args=CHROMIUM_ARGUMENTS)
        figures = _play(chromium, seconds)
        chromium.close()
    return figures


def _play(chromium: Browser, seconds: float) -> dict[str, float]:
    with game.game_page(chromium, "predictor", SIZE) as page:
        devtools = chromium.new_browser_cdp_session()
        page.evaluate(game.WATCH)
        page.wait_for_timeout(1500)
        page.evaluate("window.pictures.length = 0")
        before = _cpu_s(devtools)
        page.wait_for_timeout(seconds * 1000)
        gaps = page.evaluate("window.pictures")
        used = _cpu_s(devtools) - before
    return {
        "fps": round(1000 * len(gaps) / sum(gaps), 1),
        "p95_gap_ms": round(statistics.quantiles(gaps, n=20)[-1], 1),
        "cpu_ms_per_picture": round(1000 * used / len(gaps), 1),
    }


def _cpu_s(devtools: Any) -> float:
    """Return the CPU time of all processes of the browser."""
    return float(sum(each["cpuTime"] for each in devtools.send("SystemInfo.getProcessInfo")["processInfo"]))


def in_turn(roots: dict[str, Path], seconds: float) -> dict[str, dict[str, float]]:
    """Return the median of each figure for each revision, measured in turn."""
    found: dict[str, list[dict[str, float]]] = {name: [] for name in roots}
    for _ in range(TURNS):
        for name, root in roots.items():
            command = [sys.executable, str(Path(__file__)), "--once", "--seconds", str(seconds)]
            environment = os.environ | {"PICTURES_OF": str(root)}
            done = subprocess.run(command, check=True, capture_output=True, env=environment)
            found[name].append(json.loads(done.stdout))
    return {name: {key: statistics.median(one[key] for one in all_) for key in all_[0]} for name, all_ in found.items()}


def unpacked(revision: str, folder: Path) -> Path:
    """Return the files of a revision, with this benchmark's game."""
    archive = subprocess.run(["git", "archive", revision], check=True, capture_output=True, cwd=ROOT).stdout
    subprocess.run(["tar", "-x", "-C", str(folder)], check=True, input=archive)
    shutil.copy(ROOT / "benchmarks" / "browser.py", folder / "benchmarks" / "browser.py")
    return folder


def main() -> int:
    """Print the figures, and the processor that they are from."""
    parser = argparse.ArgumentParser(
        allow_abbrev=False, description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--seconds", type=float, default=10)
    parser.add_argument("--against", metavar="REVISION", help="measure a revision in turn with these pages")
    parser.add_argument("--once", action="store_true", help="one game in this process, as JSON")
    parser.add_argument("--json", action="store_true")
    arguments = parser.parse_args()
    if arguments.once:
        print(json.dumps(measured(arguments.seconds)))
        return 0
    with tempfile.TemporaryDirectory() as folder:
        roots = {"here": ROOT}
        if arguments.against:
            roots[arguments.against] = unpacked(arguments.against, Path(folder))
        figures = in_turn(roots, arguments.seconds)
    if arguments.json:
        print(json.dumps({"processor": described(), **figures}))
        return 0
    print(described())
    for name, row in figures.items():
        print(f"{name:12}", "  ".join(f"{key} {value}" for key, value in row.items()))
    if arguments.against:
        before, now = figures[arguments.against], figures["here"]
        pictures, cost = now["fps"] / before["fps"], now["cpu_ms_per_picture"] / before["cpu_ms_per_picture"]
        print(f"{pictures:.2f} times as many frames a second, {cost:.2f} times the processor time for each")
    return 0


if __name__ == "__main__":
    sys.exit(main())
