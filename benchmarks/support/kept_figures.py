"""Shared code of the benchmarks whose figures are stored in a file and written into documents."""

import argparse
import json
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any


@dataclass(frozen=True)
class KeptTable:
    """A table of a document whose figures are kept in a file. `begin` and `end`: the marks around it."""

    figures: Path
    document: Path
    begin: str
    end: str

    def measure_and_print(
        self,
        description: str | None,
        measured: Callable[[bool], dict[str, Any]],
        rendered: Callable[[Mapping[str, Any]], str],
    ) -> None:
        """Run a benchmark's command line: measure, print, and with --write also keep figures and table."""
        arguments = parsed(description)
        figures = measured(arguments.quick)
        print(rendered(figures))
        if arguments.write:
            keep(figures, self.figures)
            put(rendered(figures), self.document, self.begin, self.end)


def parsed(description: str | None) -> argparse.Namespace:
    """Return the command line: `write` and `quick`. Exit if both are given."""
    parser = argparse.ArgumentParser(
        allow_abbrev=False, description=description, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--write", action="store_true", help="write the figures and the tables")
    parser.add_argument(
        "--quick", action="store_true", help="one short game of each: rough figures that are not stored"
    )
    arguments = parser.parse_args()
    if arguments.quick and arguments.write:
        parser.error("--quick measures too little to be stored: leave out --write.")
    return arguments


def keep(figures: Any, path: Path) -> None:
    """Write the figures that the tables are made from."""
    path.write_text(json.dumps(figures, indent=1) + "\n", encoding="utf-8")


def put(tables: str, path: Path, begin: str, end: str) -> None:
    """Put tables into a document in place of everything from `begin` to `end`; `tables` has both marks."""
    text = path.read_text(encoding="utf-8")
    path.write_text(f"{text.partition(begin)[0]}{tables}{text.partition(end)[2]}", encoding="utf-8")
