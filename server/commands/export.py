"""`kitchenmind export`: a study's data as CSV and Parquet, with a codebook."""

import argparse
import sys
import time
from pathlib import Path

from server.commands.server_data import ServerData, add_data_options


def add_arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("--out", required=True, type=Path, metavar="DIR", help="the folder to write; it must not exist")
    add_data_options(parser)
    parser.add_argument(
        "--format",
        default="csv,parquet",
        metavar="LIST",
        help="any of csv, parquet, overcooked_ai, separated by commas",
    )
    parser.add_argument("--study", metavar="KEY", help="only this study (all its versions)")


def run(arguments: argparse.Namespace) -> int:
    """Write the export. Return 2 for wrong input, 1 if the database fails."""
    from server.commands.databases import open_stored
    from server.export.writer import ExportRefused, export
    from server.store.engines import DatabaseDown

    formats = [word.strip() for word in arguments.format.split(",") if word.strip()]
    began = time.monotonic()
    try:
        with open_stored(ServerData.of(arguments).url) as database:
            summary = database.read_now(export, arguments.out, formats, arguments.study)
    except (ValueError, ExportRefused, OSError) as error:
        sys.stderr.write(f"kitchenmind export: {error}\n")
        return 2
    except DatabaseDown as error:
        sys.stderr.write(f"kitchenmind export: {error}\n")
        return 1
    counted = ", ".join(f"{count} {name}" for name, count in summary.rows.items())
    sys.stdout.write(f"{arguments.out}: {counted} ({time.monotonic() - began:.1f} s)\n")
    return 0
