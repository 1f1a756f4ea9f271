"""`kitchenmind import`: read an export back into an empty database."""

import argparse
import sys
from pathlib import Path
from typing import TYPE_CHECKING

from server.commands.server_data import ServerData, add_data_options

if TYPE_CHECKING:
    from server.store.tombstones import Tombstone


def add_arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("folder", type=Path, metavar="DIR", help="the folder that `kitchenmind export` wrote")
    add_data_options(
        parser,
        database="a new database: sqlite:///path or postgresql://...",
        data="a new folder for `kitchenmind serve --data DIR`, with the database in it",
    )
    parser.add_argument(
        "--withdrawn",
        action="append",
        default=[],
        metavar="SOURCE",
        help="also leave out participants who withdrew according to this database or newer export; may be repeated "
        "(the server's own database is always asked)",
    )


def run(arguments: argparse.Namespace) -> int:
    """Fill the database, or leave it empty. Return 2 for an unsuitable folder or database, 1 if the database fails."""
    from server.export.importer import import_export
    from server.store.database import Database
    from server.store.engines import DatabaseDown
    from server.store.migrate import DatabaseTooNew, migrate

    try:
        new = ServerData.of(arguments)
        if not new.is_named:
            raise ValueError("name the new database with --data DIR or --database URL.")
        withdrawn = _withdrawn(arguments)
        migrate(new.url)
        with Database(new.url) as database:
            counted = database.write_now(import_export, arguments.folder, withdrawn)
    except (ValueError, KeyError, OSError, DatabaseTooNew) as error:
        sys.stderr.write(f"kitchenmind import: {error}\n")
        return 2
    except DatabaseDown as error:
        sys.stderr.write(f"kitchenmind import: {error}\n")
        return 1
    left_out = counted.pop("left out")
    sys.stdout.write(", ".join(f"{count} {name}" for name, count in counted.items()) + "\n")
    if left_out:
        people = "1 person who" if left_out == 1 else f"{left_out} people who"
        sys.stdout.write(f"left out: {people} withdrew after this export was made\n")
    return 0


def _withdrawn(arguments: argparse.Namespace) -> "list[Tombstone]":
    """Return who withdrew, according to the server's own database and the named sources. Raises ValueError."""
    from server.commands.databases import NoStoredData, open_stored
    from server.store import tombstones

    found = []
    for source in arguments.withdrawn:
        if "://" not in source and Path(source).is_dir():
            found += tombstones.read(Path(source))
        else:
            with open_stored(source) as database:
                found += database.read_now(tombstones.every)
    try:
        with open_stored(ServerData().url) as database:
            found += database.read_now(tombstones.every)
    except ValueError as error:
        if not arguments.withdrawn:
            reason = error.reason if isinstance(error, NoStoredData) else error  # here, the options name the new one
            sys.stderr.write(
                f"kitchenmind import: the server's database was not asked who withdrew ({reason}). If people withdrew "
                "after this export was made, name the database or a newer export with --withdrawn.\n"
            )
    return found
