"""Makes docs/gallery by one command, `make gallery`: a whole simulated study, its dashboard, a replay and its report.

    python tests/e2e/take_gallery.py [--participants N] [--study FILE] [--out DIR]

Everything in it is simulated and says so. With 90 participants and the published study it takes several minutes.
"""

import argparse
import asyncio
import json
import re
import subprocess
import sys
import tempfile
import time
from dataclasses import dataclass
from pathlib import Path

from PIL import Image
from playwright.sync_api import Browser, Page, sync_playwright

ROOT = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT))

from sqlalchemy import select  # noqa: E402

from analysis import apa_text  # noqa: E402
from analysis.report import Report, write_report  # noqa: E402
from server.bots.group import BotGroup, GroupOutcome, check_outcome, simulate  # noqa: E402
from server.bots.local_server import QUICK, OwnServer, kitchenmind  # noqa: E402
from server.store.database import Database  # noqa: E402
from server.store.tables import episodes  # noqa: E402
from server.study.loader import load_study  # noqa: E402
from tests.support.browser.chromium import CHROMIUM_ARGUMENTS, installed_chromium  # noqa: E402

SEED = 2026
DROPOUT = 0.06
SCREEN = {"width": 1366, "height": 900}
FIGURES = ("reward", "questionnaire", "accuracy", "effect_sizes")
WIDEST = 1400
NOTE = """**Everything on this page is simulated.** The participants are programs (`kitchenmind bots`) that follow the
rules in `server/bots/foresight` and `server/bots/answers.py`, built so that foresight can help. Their data are not
evidence about people. The page shows what the tools produce, from the running dashboard to the report."""


@dataclass
class Made:
    """The data for the pictures and the page."""

    outcome: GroupOutcome
    minutes: float
    report: Report


def signed_in(chromium: Browser, server: OwnServer, study: str) -> Page:
    made = subprocess.run(
        kitchenmind("admin", "--database", server.database, "create", "gallery"),
        capture_output=True,
        text=True,
        check=True,
        stdin=subprocess.DEVNULL,
    )
    password = re.search(r"password: (\S+)", made.stdout)
    assert password, made.stdout
    page = chromium.new_context(viewport=SCREEN).new_page()  # type: ignore[arg-type]
    page.set_default_timeout(60_000)
    page.goto(f"{server.url}/admin/s/{study}")
    page.fill("[name=name]", "gallery")
    page.fill("[name=password]", password.group(1))
    page.click("form button")
    page.wait_for_url(f"**/admin/s/{study}")
    page.click(".switch")  # blind mode off: there is nobody whose condition could be given away
    page.wait_for_load_state()
    return page


def walk(group: BotGroup, server: OwnServer, page: Page, out: Path) -> GroupOutcome:
    """Run the bots through the study in a separate process; take a picture of the dashboard while it runs."""
    words = [
        sys.executable,
        __file__,
        "--walk",
        json.dumps([group.number, server.url, server.database, str(group.study_name)]),
    ]
    with tempfile.TemporaryFile("w+") as said:
        walking = subprocess.Popen(words, stdout=said)
        time.sleep(max(20.0, group.number / 2))
        page.reload()
        page.wait_for_timeout(6_000)
        take(page, out / "dashboard.webp")
        assert walking.wait() == 0
        said.seek(0)
        return GroupOutcome(**json.load(said))


def walk_here(number: int, url: str, database: str, study_file: str) -> None:
    """The part that `walk` starts."""
    group = BotGroup(number, load_study(study_file).study.name, load_study(study_file).study, DROPOUT, SEED)
    with Database(database, read_only=True) as kept:
        bots = asyncio.run(simulate(group, url, kept))
        print(json.dumps(check_outcome(bots, kept).__dict__))


def take(page: Page, path: Path, full: bool = False) -> None:
    """Take a picture, compressed to the allowed size."""
    shot = path.with_suffix(".png")
    page.screenshot(path=shot, full_page=full)
    small(shot, path)
    shot.unlink()


def small(source: Path, path: Path) -> None:
    image = Image.open(source).convert("RGB")
    if image.width > WIDEST:
        image = image.resize((WIDEST, round(image.height * WIDEST / image.width)))
    image.save(path, "WEBP", quality=82, method=6)


def replay(page: Page, server: OwnServer, study: str, out: Path) -> None:
    """The game with the most soups in which marks were shown, in its middle."""
    query = select(episodes.c.id).where(episodes.c.kind == "episode", episodes.c.status == "done")
    best = query.where(episodes.c.shown == "predictor").order_by(episodes.c.score.desc()).limit(1)
    with Database(server.database, read_only=True) as kept:
        episode = kept.read_now(lambda connection: connection.execute(best).scalar())
    page.goto(f"{server.url}/admin/s/{study}/game/{episode}#t=120")
    page.wait_for_timeout(5_000)
    take(page, out / "replay.webp")


def make(number: int, study_file: Path, out: Path) -> None:
    study = load_study(study_file).study
    group = BotGroup(number, str(study_file), study, DROPOUT, SEED)
    out.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory() as folder, sync_playwright() as playwright:
        database = f"sqlite:///{Path(folder) / 'gallery.sqlite3'}"
        chromium = playwright.chromium.launch(executable_path=installed_chromium(), args=CHROMIUM_ARGUMENTS)
        with OwnServer(database, study_file, QUICK) as server:
            page = signed_in(chromium, server, study.name)
            began = time.monotonic()
            outcome = walk(group, server, page, out)
            minutes = (time.monotonic() - began) / 60
            page.goto(f"{server.url}/admin/s/{study.name}")
            page.wait_for_timeout(8_000)
            take(page, out / "after.webp", full=True)
            replay(page, server, study.name, out)
        subprocess.run(kitchenmind("export", "--database", database, "--out", f"{folder}/export"), check=True)
        report = write_report(Path(folder) / "export", Path(folder) / "report")
        page.goto(f"file://{folder}/report/report.html")
        take(page, out / "report.webp")
        for name in FIGURES:
            figure = Path(folder) / "report" / "figures" / f"{name}.png"
            if figure.is_file():
                small(figure, out / f"{name}.webp")
        (out / "README.md").write_text(written(Made(outcome, minutes, report), study.name, out), encoding="utf-8")
        chromium.close()


def written(made: Made, study: str, out: Path) -> str:
    """Return the page: what was simulated, the pictures, and the report's sentences."""
    outcome, analysis = made.outcome, made.report.analysis
    arms = ", ".join(f"{count} in `{condition}`" for condition, count in outcome.by_condition.items())
    findings = "\n".join(f"- {finding}" for finding in apa_text.findings(analysis))
    figures = "\n\n".join(
        f"![{name.replace('_', ' ')}, simulated]({name}.webp)" for name in FIGURES if (out / f"{name}.webp").is_file()
    )
    return f"""# A simulated study, from the dashboard to the report

{NOTE}

Made by `make gallery`: {outcome.started} simulated participants of `{study}` (seed {SEED}), of whom
{outcome.completed} finished ({arms}) and {outcome.dropped} dropped out; {outcome.episodes} episodes,
{len(outcome.violations)} violations, {made.minutes:.0f} minutes on a fast clock.

## The running study

![The dashboard while simulated participants play](dashboard.webp)

## The finished study

![The dashboard after the simulated study](after.webp)

## A replayed episode

![A replayed episode with the predicted steps, simulated](replay.webp)

## The report

![The first page of the report on simulated data](report.webp)

{figures}

The sentences of the report about these programs:

{findings}
"""


def main() -> int:
    parser = argparse.ArgumentParser(allow_abbrev=False, description=__doc__)
    parser.add_argument("--participants", type=int, default=90)
    parser.add_argument("--study", type=Path, default=ROOT / "studies" / "external_predictor.yaml")
    parser.add_argument("--out", type=Path, default=ROOT / "docs" / "gallery")
    parser.add_argument("--walk", help=argparse.SUPPRESS)
    arguments = parser.parse_args()
    if arguments.walk:
        walk_here(*json.loads(arguments.walk))
    else:
        make(arguments.participants, arguments.study, arguments.out)
    return 0


if __name__ == "__main__":
    sys.exit(main())
