"""The command line of kitchenmind. Each command imports its package only when it runs, so that --help is quick."""

import atexit
import gc
import importlib
import os
import select
import sys
from collections.abc import Sequence
from importlib.metadata import PackageNotFoundError, version

from kitchenmind import extras
from kitchenmind.argument_parser import ExactArgumentParser
from kitchenmind.bundled_studies import use_bundled_studies

# verb -> (module with `add_arguments(parser)` and `run(arguments) -> int`, what it does)
VERBS: dict[str, tuple[str, str]] = {
    "replay": ("overcooked.replay", "re-simulate action logs to states"),
    "train": ("training.commands.train", "train agents, predictors, or all models of a study"),
    "collect": ("training.commands.collect", "collect the trajectories that a predictor learns from"),
    "agent": (
        "models.agents.check",
        "check an agent or a predictor before a study uses it, or serve an agent over HTTP",
    ),
    "evaluate": ("training.commands.evaluate", "measure agents and predictors"),
    "serve": ("server.commands.serve", "serve a study"),
    "doctor": (
        "server.commands.doctor",
        "check whether this machine can serve: port, disk, TLS, secret, database, Redis, weights",
    ),
    "admin": ("server.commands.admin", "manage researchers' accounts for the dashboard"),
    "person": ("server.commands.person", "find or delete one participant on request"),
    "study": ("server.commands.study", "create, check or translate a study file, manage kept models, delete its data"),
    "bundle": ("server.commands.bundle", "pack a study into one archive for preregistration"),
    "export": ("server.commands.export", "write a study's data as CSV and Parquet"),
    "verify": (
        "server.commands.verify",
        "re-simulate every stored episode, compare the hashes, check the audit log",
    ),
    "backup": ("server.commands.backup", "copy a SQLite database, also while the server runs"),
    "import": ("server.commands.importer", "read an export back into an empty database"),
    "bots": ("server.commands.bots", "run simulated participants through a study and check every guarantee"),
    "conformance": ("server.commands.conformance", "check a running server against the protocol"),
    "report": ("analysis.commands.report", "analyse an exported study: report page, figures, table of results"),
    "power": ("analysis.commands.power", "compute how many participants a study needs"),
}


GARBAGE_THRESHOLDS = (50_000, 20, 20)  # imports make hundreds of thousands of objects and no garbage


def main(argv: Sequence[str] | None = None) -> int:
    """Run one command; return the exit status: 0 done, 1 failed, 2 wrong input, 130 stopped by Ctrl+C, 141 if the
    reader of its output has closed it, as after `| head`."""
    if argv is None:  # this process is the command
        gc.set_threshold(*GARBAGE_THRESHOLDS)
        atexit.register(gc.freeze)  # otherwise Python examines every object once more before it ends
    try:
        status = _run(list(sys.argv[1:] if argv is None else argv))
        sys.stdout.flush()
    except BrokenPipeError:
        if not _is_unread():
            raise
        return 141
    return status


def _is_unread() -> bool:
    """Return whether the reader of standard output has closed it. If so, discard the remaining output, so that Python
    does not fail again at its end."""
    poll = select.poll()
    poll.register(sys.stdout.fileno(), 0)
    if not poll.poll(0):
        return False
    os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
    return True


def _version() -> str:
    try:
        return f"kitchenmind {version('kitchenmind')}"
    except PackageNotFoundError:  # run by its path, `python PATH/kitchenmind`, and not installed
        return "kitchenmind, not installed"


def _run(words: list[str]) -> int:
    verb = words[0] if words else None
    parser = ExactArgumentParser(prog="kitchenmind", description=__doc__ if verb is None else None)
    if verb not in VERBS:
        parser.add_argument("--version", action="version", version=_version(), help="show the version and exit")
    verbs = parser.add_subparsers(dest="verb", metavar="VERB", required=True)
    for name, (_, purpose) in VERBS.items():
        verbs.add_parser(name, help=purpose, description=purpose, add_help=name == verb)
    if verb not in VERBS:
        parser.parse_args(words)
        return 2
    try:
        module = importlib.import_module(VERBS[verb][0])
        module.add_arguments(verbs.choices[verb])
        arguments = parser.parse_args(words)
        use_bundled_studies(arguments)
        return int(module.run(arguments))
    except ModuleNotFoundError as error:
        if error.name is None or (extras.ROOT / error.name.split(".")[0]).exists():
            raise
        package = VERBS[verb][0].partition(".")[0]
        remedy = extras.install_command(package if package in ("training", "analysis") else "")
        print(f"kitchenmind {verb} needs the Python package {error.name}: run `{remedy}`.", file=sys.stderr)
        return 2
    except KeyboardInterrupt:
        return 130
