"""`kitchenmind bots`: run simulated participants through a study over real HTTP and websockets, and check every
guarantee.
"""

import argparse
import json
import os
import sys
import tempfile
import time
from contextlib import ExitStack
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING
from urllib.parse import urlsplit

from server.commands.server_data import ServerData, add_data_options

if TYPE_CHECKING:
    from server.bots.group import BotGroup, GroupOutcome
    from server.bots.participant import Bot
    from server.store.database import Database

MOST = 2000


def add_arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("number", type=int, metavar="N", help="number of participants")
    parser.add_argument(
        "--study",
        type=Path,
        metavar="FILE",
        help="the study file (studies/quick_look.yaml); with --url also the name of a study that the server offers",
    )
    parser.add_argument("--url", help="a server that is running; without it, the command starts one")
    add_data_options(
        parser,
        database="keep the data here, sqlite:///path; with --url: the server's own database",
        data="the folder of `kitchenmind serve --data DIR`: its kitchens, its models, and its database for the data",
    )
    parser.add_argument(
        "--dropout", type=float, default=0.0, metavar="P", help="share of participants who drop out (0.0)"
    )
    parser.add_argument(
        "--seed", type=int, default=0, metavar="S", help="seed; the same seed gives the same participants (0)"
    )
    parser.add_argument(
        "--cook",
        choices=("foresight", "credulous", "planner", "clone"),
        default="foresight",
        help="how they play: foresight (default) uses arrows that prove right, credulous believes all arrows, planner "
        "follows a plan, clone imitates recorded people",
    )
    parser.add_argument("--fast", action="store_true", help="play as fast as this machine can")
    parser.add_argument("--json", action="store_true", help="print the outcome as JSON")
    parser.add_argument(
        "--faults",
        action="store_true",
        help="kill the server, break connections, open second tabs; prints PASS or FAIL for each guarantee",
    )


def run(arguments: argparse.Namespace) -> int:
    """Return 0 if every guarantee holds, 1 if some do not or the server failed, 2 for wrong input."""
    from server.bots.local_server import ServerFailed
    from server.store.database import DatabaseDown
    from server.study.loader import StudyError

    try:
        _check(arguments)
        if arguments.faults:
            return _try_out(arguments)
        outcome = _simulate(arguments)
    except (ValueError, StudyError, FileNotFoundError) as error:
        return _refuse(error, 2)
    except (ServerFailed, DatabaseDown, OSError) as error:
        return _refuse(error, 1)
    print(json.dumps(asdict(outcome)) if arguments.json else _table(outcome))
    return 1 if outcome.violations else 0


def _check(arguments: argparse.Namespace) -> None:
    """Check the ranges of numbers. Raises ValueError with the remedy."""
    if not 1 <= arguments.number <= MOST:
        raise ValueError(f"{arguments.number} participants cannot be simulated. Give a number from 1 to {MOST}.")
    if not 0 <= arguments.dropout <= 1:
        raise ValueError(f"--dropout {arguments.dropout:g} is not a share of participants. Give a number from 0 to 1.")
    if arguments.url and not arguments.url.startswith(("http://", "https://")):
        raise ValueError(
            f"--url {arguments.url} is not an address. Give it as the browser shows it: http://127.0.0.1:8000."
        )
    if arguments.url and not _is_local(arguments.url) and not _secret():
        raise ValueError(
            f"{arguments.url} would count the bots as people. Give them the server's secret: set KITCHENMIND_SECRET."
        )
    if arguments.url and arguments.faults:
        raise ValueError("--faults kills the server: it needs one of its own. Leave out --url.")
    if database := _database(arguments):
        from server.store.engines import normal_url

        normal_url(database)


def _database(arguments: argparse.Namespace) -> str | None:
    """Return the database that the options name. Raises ValueError."""
    server = ServerData.of(arguments)
    return server.url if server.is_named else None


def _is_local(url: str) -> bool:
    return urlsplit(url).hostname in ("127.0.0.1", "::1", "localhost")


def _secret() -> str:
    """Return the server's secret, with which bots identify themselves to a public server."""
    return os.environ.get("KITCHENMIND_SECRET", "")


def _simulate(arguments: argparse.Namespace) -> "GroupOutcome":
    from server.bots.local_server import QUICK, OwnServer
    from server.settings import ROOT

    study = arguments.study or ROOT / "studies" / "quick_look.yaml"
    group = _group(arguments, study)
    if arguments.url:
        if arguments.fast:
            _say(arguments, "the server at --url has its own clock: --fast needs a server that this command starts")
        return _run_group(arguments, group, arguments.url, _database(arguments))
    with ExitStack() as stack:
        folder = stack.enter_context(tempfile.TemporaryDirectory(prefix="kitchenmind-bots-"))
        database = _database(arguments) or f"sqlite:///{Path(folder) / 'bots.sqlite3'}"
        _say(arguments, "starting a server ...")
        study, environment = _with_kitchens(study, Path(folder), arguments.data)
        server = stack.enter_context(OwnServer(database, study, environment | (QUICK if arguments.fast else {})))
        return _run_group(arguments, group, server.url, database)


def _try_out(arguments: argparse.Namespace) -> int:
    """Run `--faults`; return 0 if every guarantee holds."""
    import asyncio
    from dataclasses import replace

    import uvloop

    from server.bots.faults import BROWSER_FAULTS, table, try_out
    from server.bots.local_server import QUICK, OwnServer
    from server.commands.databases import open_stored
    from server.settings import ROOT

    study = arguments.study or ROOT / "studies" / "quick_look.yaml"
    group = replace(_group(arguments, study), browser_faults=BROWSER_FAULTS)
    with ExitStack() as stack:
        folder = stack.enter_context(tempfile.TemporaryDirectory(prefix="kitchenmind-bots-"))
        url = _database(arguments) or f"sqlite:///{Path(folder) / 'bots.sqlite3'}"
        _say(arguments, "starting a server that will be killed ...")
        study, environment = _with_kitchens(study, Path(folder), arguments.data)
        server = stack.enter_context(OwnServer(url, study, environment | QUICK))
        database = stack.enter_context(open_stored(url))
        with asyncio.Runner(loop_factory=uvloop.new_event_loop) as runner:
            trial = runner.run(try_out(group, server, database))
    rows = trial.rows()
    if arguments.json:
        kept = {guarantee: is_kept for guarantee, is_kept, _ in rows}
        print(json.dumps(asdict(trial.outcome) | {"faults": trial.faults, "guarantees": kept}))
    else:
        print(table(trial, arguments.seed))
    return 0 if all(is_kept for _, is_kept, _ in rows) else 1


def _group(arguments: argparse.Namespace, study_file: Path) -> "BotGroup":
    """Return the simulated participants. Raises StudyError, FileNotFoundError; ValueError if a server has no study."""
    from server.bots.cook import layouts_without_human_bc
    from server.bots.group import BotGroup
    from server.commands.databases import load_stored
    from server.participation.episode_specs import layout_of
    from server.required_models import required_models
    from server.study.loader import StudyError
    from server.study_check import missing_problems

    if arguments.url and (not arguments.study or _is_name(arguments.study)):
        offered = offered_study(arguments.url, arguments.study and arguments.study.name)
        return BotGroup(
            arguments.number, offered, None, arguments.dropout, arguments.seed, secret=_secret(), cook=arguments.cook
        )
    file = load_stored(study_file, ServerData(arguments.data))
    if not arguments.url:
        missing = [file.describe(problem) for problem in missing_problems(file, required_models([file]))]
        if missing:
            raise StudyError(missing)
    study = file.study
    if arguments.cook == "clone" and (lacking := layouts_without_human_bc(map(layout_of, study.layouts))):
        raise ValueError(
            f"--cook clone: there is no behaviour-cloned human for {', '.join(lacking)}. Use --cook foresight; or "
            "train one with recorded games of people: python -m training.behaviour_cloning --layout NAME."
        )
    secret = _secret() if arguments.url else ""
    return BotGroup(
        arguments.number, study.name, study, arguments.dropout, arguments.seed, secret=secret, cook=arguments.cook
    )


def _with_kitchens(study: Path, folder: Path, data: Path | None) -> tuple[Path, dict[str, str]]:
    """Return the study file for a server with an own database, and that server's environment. The database has no
    kitchens of the dashboard: if the study names one, its grid is written into a copy of the file in `folder`. Models
    that were trained here stay where they are. `data`: the folder with both, else that of the settings."""
    from server.commands.databases import load_stored

    file = load_stored(study, ServerData(data))
    uses_data = data is not None or bool(file.study.checkpoints)
    own = {"KITCHENMIND_DATA": str(file.own_models.parent)} if uses_data and file.own_models else {}
    if file.text == study.read_bytes().decode("utf-8"):
        return study, own
    copy = folder / f"{file.study.name}.yaml"
    copy.write_text(file.text, encoding="utf-8", newline="")
    return copy, own | {"KITCHENMIND_MODELS_FOLDER": str(file.folder)}


def _is_name(study: Path) -> bool:
    """Return whether this is a study's name and not a file: a study made in the dashboard has no file."""
    return study.name == str(study) and not study.suffix and not study.exists()


def offered_study(url: str, wanted: str | None = None) -> str:
    """Return the study of this name that a server offers, or the first one. Raises ValueError without a server or such
    a study."""
    import re

    import httpx

    try:
        page = httpx.get(url, headers={"Accept": "text/html"}, follow_redirects=True, timeout=10)
    except httpx.HTTPError as error:
        raise ValueError(f"there is no server at {url} ({error}). Start it with `kitchenmind serve`.") from None
    offered = list(dict.fromkeys(re.findall(r'href="[^"?]*/s/([a-z][a-z0-9_-]*)', page.text)))
    if not offered:
        raise ValueError(f"{url} offers no study. Name it with --study FILE.")
    if wanted is not None and wanted not in offered:
        raise ValueError(f"{url} offers no study {wanted!r}. It offers {', '.join(offered)}; or name a file.")
    return wanted or offered[0]


def _run_group(arguments: argparse.Namespace, group: "BotGroup", url: str, database_url: str | None) -> "GroupOutcome":
    """Run everybody through the study, then check the guarantees."""
    import asyncio

    import uvloop

    from server.bots.group import check_outcome
    from server.commands.databases import open_stored

    with ExitStack() as stack:
        database = stack.enter_context(open_stored(database_url)) if database_url else None
        began = time.monotonic()
        with asyncio.Runner(loop_factory=uvloop.new_event_loop) as runner:
            bots = runner.run(_simulated(arguments, group, url, database))
        _say(arguments, f"{len(bots)} participants in {time.monotonic() - began:.0f} s; checking what they leave ...")
        return check_outcome(bots, database, group.study)


async def _simulated(
    arguments: argparse.Namespace, group: "BotGroup", url: str, database: "Database | None"
) -> "list[Bot]":
    """Simulate the participants, and say how far they are."""
    from server.bots.group import simulate
    from server.bots.group_progress import GroupProgress, reported

    if arguments.json:
        return await simulate(group, url, database)
    progress = GroupProgress(group.number)
    async with reported(progress, sys.stderr):
        return await simulate(group, url, database, progress.finish, progress.bots.extend)


def _say(arguments: argparse.Namespace, words: str) -> None:
    if not arguments.json:
        print(words, file=sys.stderr, flush=True)


def _table(outcome: "GroupOutcome") -> str:
    lines = [
        f"{'started':<12}{outcome.started:>6}",
        f"{'completed':<12}{outcome.completed:>6}",
        f"{'dropped':<12}{outcome.dropped:>6}",
        f"{'episodes':<12}{outcome.episodes:>6}",
    ]
    lines += [f"  {condition:<10}{count:>6}  completed" for condition, count in outcome.by_condition.items()]
    if outcome.late_timesteps:
        remedy = "timesteps without an answer of the models: the partner waited (try `kitchenmind agent check`)"
        lines.append(f"{'late':<12}{outcome.late_timesteps:>6}  {remedy}")
    lines.append(f"{'violations':<12}{len(outcome.violations):>6}")
    lines += [f"  {violation}" for violation in outcome.violations]
    return "\n".join(lines)


def _refuse(error: Exception, status: int) -> int:
    print(f"kitchenmind bots: {error}", file=sys.stderr)
    return status
