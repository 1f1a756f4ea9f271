"""`kitchenmind doctor`: check whether this machine is ready to serve, and name the remedy for each problem."""

import argparse
import sys
from contextlib import ExitStack

from server.commands import serve

_SIGNS = {"good": "ok  ", "look": "look", "bad": "BAD "}


def add_arguments(parser: argparse.ArgumentParser) -> None:
    serve.add_arguments(parser)


def run(arguments: argparse.Namespace) -> int:
    """Return 0 if the machine is ready (perhaps with warnings), 1 if something is wrong, 2 if a setting is invalid."""
    with ExitStack() as stack:
        try:
            stack.enter_context(serve.unbundled(arguments))
            settings = serve.settings_of(arguments)
        except (ValueError, OSError) as error:
            sys.stderr.write(f"kitchenmind doctor: {error}\n")
            return 2
        from server.doctor import examine

        worst = "good"
        for finding in examine(settings):
            print(f"{_SIGNS[finding.grade]}  {finding.about:<9} {finding.text}", flush=True)
            worst = "bad" if "bad" in (worst, finding.grade) else worst
    print("not ready: fix everything marked BAD" if worst == "bad" else "ready: kitchenmind serve")
    return int(worst == "bad")
