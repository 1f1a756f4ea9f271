"""Takes the pictures of the game in docs/images: a real round with the trained agent and its predictor.

`python tests/journeys/take_pictures.py FOLDER` leaves several of each size to choose from.
"""

import shutil
import sys
import tempfile
from pathlib import Path
from typing import Any

from browser_cook import BrowserCook
from conftest import CHROMIUM_ARGUMENTS
from game_page import DESKTOP, PHONE
from playwright.sync_api import Browser, sync_playwright
from real_server import RealServer
from test_game_browser_real import go_to_game, study

MOMENTS = range(90, 330, 20)
STUDY = study(
    400,
    ("flow: [introduction, tutorial, episodes, thanks]", "flow: [episodes, thanks]"),
    (
        "agents: [{name: planner, predictor: sp_predictor_stream}]",
        "agents: [{name: sp}]\npredictor: {form: stream, steps_shown: 3}",
    ),
    ("title: {en: Ring}", "title: {en: Coordination Ring}"),
)


def take(chromium: Browser, server: RealServer, folder: Path, name: str, **context: Any) -> None:
    """One round; a picture at each of the moments."""
    page = chromium.new_context(**context).new_page()
    cook = BrowserCook(page)
    go_to_game(page, server)
    for moment in MOMENTS:
        cook.play(until_timestep=moment)
        page.screenshot(path=folder / f"{name}-{moment}.png")
        print(name, moment, cook.predictions[-1], flush=True)
    page.context.close()


def main() -> None:
    folder = Path(sys.argv[1])
    folder.mkdir(parents=True, exist_ok=True)
    with RealServer(Path(tempfile.mkdtemp()), speed=1.0, study=STUDY) as server, sync_playwright() as playwright:
        chromium = playwright.chromium.launch(executable_path=shutil.which("chromium"), args=CHROMIUM_ARGUMENTS)
        take(chromium, server, folder, "game", viewport=DESKTOP)
        take(chromium, server, folder, "phone", viewport=PHONE, has_touch=True, is_mobile=True, device_scale_factor=2)
        chromium.close()


if __name__ == "__main__":
    main()
