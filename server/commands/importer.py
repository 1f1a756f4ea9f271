"""`kitchenmind import`: reads an export back into an empty database."""

import argparse
import sys
from pathlib import Path


def add_arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("folder", type=Path, metavar="DIR", help="what `kitchenmind export --out DIR` wrote")
    parser.add_argument(
        "--database", required=True, metavar="URL", help="a new database: sqlite:///path or postgresql://..."
    )


def run(arguments: argparse.Namespace) -> int:
    """Fills the database, or leaves it empty: 2 for a folder or database that will not do, 1 if the database fails."""
    from server.store.database import Database
    from server.store.engines import DatabaseDown
    from server.store.importer import import_export
    from server.store.migrate import DatabaseTooNew, migrate

    try:
        migrate(arguments.database)
        with Database(arguments.database) as database:
            counted = database.write_now(import_export, arguments.folder)
    except (ValueError, KeyError, OSError, DatabaseTooNew) as error:
        sys.stderr.write(f"kitchenmind import: {error}\n")
        return 2
    except DatabaseDown as error:
        sys.stderr.write(f"kitchenmind import: {error}\n")
        return 1
    sys.stdout.write(", ".join(f"{count} {name}" for name, count in counted.items()) + "\n")
    return 0
