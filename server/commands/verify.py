"""`kitchenmind verify`: re-simulate every stored episode from its own grid and actions, compare all hashes, and check
that the audit log is complete.
"""

import argparse
import sys
from collections.abc import Iterable
from dataclasses import dataclass
from typing import TYPE_CHECKING

from server.commands.server_data import ServerData, add_data_options

if TYPE_CHECKING:
    from sqlalchemy import Connection

    from server.verification import VerificationResult

LISTED = 20


@dataclass
class _Line:
    """The result for one layout."""

    episodes: int = 0
    timesteps: int = 0
    different: int = 0


def add_arguments(parser: argparse.ArgumentParser) -> None:
    add_data_options(parser)
    parser.add_argument("--study", metavar="KEY", help="only this study (all its versions)")


def run(arguments: argparse.Namespace) -> int:
    """Return 0 if every episode re-simulates to the same states and the audit log is complete, 1 if not or if the
    database failed, 2 for wrong input."""
    from server.commands.databases import open_stored
    from server.store.engines import DatabaseDown

    try:
        with open_stored(ServerData.of(arguments).url) as database:
            lines, status = database.read_now(_verify, arguments.study)
    except ValueError as error:
        sys.stderr.write(f"kitchenmind verify: {error}\n")
        return 2
    except DatabaseDown as error:
        sys.stderr.write(f"kitchenmind verify: {error}\n")
        return 1
    sys.stdout.writelines(lines)  # after the transaction: printing may block on a pager
    return status


def _verify(connection: "Connection", study: str | None) -> tuple[list[str], int]:
    from server.store import audit, studies
    from server.verification import verify_all

    chosen = None
    if study is not None:
        chosen = tuple(version.id for version in studies.every(connection, study))
        if not chosen:
            known = ", ".join(sorted({version.key for version in studies.every(connection)})) or "none"
            raise ValueError(f"there is no study {study!r} in this database. It has: {known}.")
    lines, status = report(verify_all(connection, chosen))
    forged = audit.first_forged(connection)
    if forged is None:
        return [*lines, "The audit log is complete.\n"], status
    return [*lines, f"The audit log was changed: entry {forged} is missing or is not what was written.\n"], 1


def report(results: "Iterable[VerificationResult]") -> tuple[list[str], int]:
    """Return a line for each layout and for the first differences, and the exit status."""
    lines: dict[str, _Line] = {}
    different: list[VerificationResult] = []
    for result in results:
        line = lines.setdefault(result.layout, _Line())
        line.episodes += 1
        line.timesteps += result.timesteps
        if result.difference is not None:
            line.different += 1
            different.append(result)
    report_lines = [f"{'layout':<24}{'episodes':>10}{'timesteps':>12}{'different':>11}\n"]
    for layout, line in sorted(lines.items()):
        report_lines.append(f"{layout:<24}{line.episodes:>10}{line.timesteps:>12}{line.different:>11}\n")
    for result in different[:LISTED]:
        place = "" if result.timestep is None else f", timestep {result.timestep}"
        report_lines.append(f"episode {result.episode}{place}: {result.difference}\n")
    if len(different) > LISTED:
        report_lines.append(f"... and {len(different) - LISTED} more episodes\n")
    report_lines.append("Every episode was simulated to the same states.\n" if not different else "")
    return report_lines, 1 if different else 0
