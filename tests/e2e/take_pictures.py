"""Takes the pictures of the game in docs/images: a real round with the trained agent and its predictor.

`python tests/e2e/take_pictures.py FOLDER` leaves several of each size to choose from, and game.webp, an
animation of eight seconds for the README.
"""

import sys
import tempfile
from io import BytesIO
from pathlib import Path
from typing import Any

from PIL import Image
from playwright.sync_api import Browser, sync_playwright

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))

from tests.e2e.test_game_browser_real import go_to_game, study
from tests.support.browser.browser_cook import BrowserCook
from tests.support.browser.chromium import CHROMIUM_ARGUMENTS, installed_chromium
from tests.support.browser.game_page import DESKTOP, PHONE
from tests.support.real_server import RealServer

MOMENTS = range(90, 330, 20)
ANIMATED, FRAME_MS, WIDTH = range(100, 140), 200, 800
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


def animate(chromium: Browser, server: RealServer, target: Path) -> None:
    """Consecutive timesteps of a round, one picture each, as an animated WebP. The server runs slowly."""
    page = chromium.new_context(viewport=DESKTOP).new_page()
    cook = BrowserCook(page)
    go_to_game(page, server)
    frames = []
    for moment in ANIMATED:
        cook.play(until_timestep=moment)
        picture = Image.open(BytesIO(page.screenshot())).convert("RGB")
        frames.append(picture.resize((WIDTH, picture.height * WIDTH // picture.width), Image.Resampling.LANCZOS))
    frames[0].save(target, save_all=True, append_images=frames[1:], duration=FRAME_MS, loop=0, quality=70, method=6)
    page.context.close()


def main() -> None:
    folder = Path(sys.argv[1])
    folder.mkdir(parents=True, exist_ok=True)
    with RealServer(Path(tempfile.mkdtemp()), speed=0.5, study=STUDY) as server, sync_playwright() as playwright:
        chromium = playwright.chromium.launch(executable_path=installed_chromium(), args=CHROMIUM_ARGUMENTS)
        animate(chromium, server, folder / "game.webp")
        chromium.close()
    with RealServer(Path(tempfile.mkdtemp()), speed=1.0, study=STUDY) as server, sync_playwright() as playwright:
        chromium = playwright.chromium.launch(executable_path=installed_chromium(), args=CHROMIUM_ARGUMENTS)
        take(chromium, server, folder, "game", viewport=DESKTOP)
        take(chromium, server, folder, "phone", viewport=PHONE, has_touch=True, is_mobile=True, device_scale_factor=2)
        chromium.close()


if __name__ == "__main__":
    main()
