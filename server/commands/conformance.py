"""`kitchenmind conformance URL`: check that a running server follows the protocol. One line for each check."""

import argparse
import json
import os
import sys
from dataclasses import asdict
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from kitchenmind.client.conformance import Finding


def add_arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("url", metavar="URL", help="the server's address, as the browser shows it")
    parser.add_argument(
        "--study", metavar="NAME", help="the study to take part in (the first one that the server offers)"
    )
    parser.add_argument("--json", action="store_true", help="print the findings as JSON")


def run(arguments: argparse.Namespace) -> int:
    """Return 0 if the server passed every check, 1 if it failed some, 2 if there is no server or no study."""
    import asyncio

    from kitchenmind.client.conformance import Conformance
    from server.commands.bots import offered_study

    try:
        if not arguments.url.startswith(("http://", "https://")):
            raise ValueError(
                f"{arguments.url} is not an address. Give it as the browser shows it: http://127.0.0.1:8000."
            )
        _require_server(arguments.url)
        study = arguments.study or offered_study(arguments.url)
    except ValueError as error:
        print(f"kitchenmind conformance: {error}", file=sys.stderr)
        return 2
    secret = os.environ.get("KITCHENMIND_SECRET", "")
    findings = asyncio.run(Conformance(arguments.url, study, secret).run(None if arguments.json else _say))
    failed = sum(not finding.passed for finding in findings)
    if arguments.json:
        print(json.dumps([asdict(finding) for finding in findings]))
    else:
        print(f"{len(findings) - failed} of {len(findings)} checks passed")
    return 1 if failed else 0


def _require_server(url: str) -> None:
    """Raise ValueError if nothing answers at the address: every check would fail for this reason alone."""
    import httpx

    try:
        httpx.get(url, timeout=10)
    except httpx.HTTPError as error:
        raise ValueError(f"there is no server at {url} ({error}). Start it with `kitchenmind serve`.") from None


def _say(finding: "Finding") -> None:
    print(f"{'passed' if finding.passed else 'FAILED'}  {finding.name}", flush=True)
    if finding.reason:
        print(f"        {finding.reason}", flush=True)
