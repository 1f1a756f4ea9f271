"""`kitchenmind backup`: copy a SQLite database while the server runs. For PostgreSQL, use pg_dump."""

import argparse
import sys
from pathlib import Path

from server.commands.server_data import ServerData, add_data_options


def add_arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("--to", required=True, type=Path, metavar="FILE", help="the file to write; it must not exist")
    add_data_options(parser, database="sqlite:///path")


def run(arguments: argparse.Namespace) -> int:
    """Write the copy. Return 2 for wrong input, 1 if the database fails."""
    from server.commands.databases import open_stored
    from server.store.backup import copy_to
    from server.store.engines import DatabaseDown

    try:
        with open_stored(ServerData.of(arguments).url) as database:
            copy_to(database.url, arguments.to)
    except (ValueError, OSError) as error:
        sys.stderr.write(f"kitchenmind backup: {error}\n")
        return 2
    except DatabaseDown as error:
        sys.stderr.write(f"kitchenmind backup: {error}\n")
        return 1
    sys.stdout.write(f"{arguments.to}: {arguments.to.stat().st_size / 1e6:.1f} MB\n")
    return 0
