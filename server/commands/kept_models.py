"""`kitchenmind study models`: the copies of trained models that versions of studies keep. Imports are inside
functions, so that --help is quick.
"""

import argparse
import sys
from typing import TYPE_CHECKING

from server.commands.server_data import ServerData, add_data_options

if TYPE_CHECKING:
    from sqlalchemy import Connection

    from models.agents.own_checkpoints import OwnCheckpoint

_MB = 1_000_000


def add_arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("--delete-unused", action="store_true", help="delete the copies that nothing stored names")
    add_data_options(parser)


def run(arguments: argparse.Namespace) -> int:
    """Return 0 if done, 2 for wrong input, 1 if the database failed or a copy could not be deleted."""
    from models.agents.own_checkpoints import OwnCheckpoints
    from server.commands.databases import open_stored
    from server.store.engines import DatabaseDown

    try:
        server = ServerData.of(arguments)
        checkpoints = OwnCheckpoints(server.own_models)
        copies = checkpoints.kept()
        with open_stored(server.url) as database:
            users = database.read_now(_users, [copy.sha256 for copy in copies])
        for copy in copies:
            print(_line(copy, users[copy.sha256]))
        unused = [copy for copy in copies if not users[copy.sha256]]
        summary = _summary(copies, unused, arguments.delete_unused)
        for copy in unused if arguments.delete_unused else ():
            checkpoints.drop(copy.sha256)
        print(summary)
    except ValueError as error:
        return _refuse(error, 2)
    except (DatabaseDown, OSError) as error:
        return _refuse(error, 1)
    return 0


def _users(connection: "Connection", hashes: list[str]) -> dict[str, list[str]]:
    """Return what names each of these SHA-256: versions of studies, by their text whether or not it can still be read,
    and episodes. Raises ValueError for a database without studies, which is probably another server's."""
    from sqlalchemy import select

    from server.store import studies
    from server.store.tables import episodes

    versions = studies.every(connection)
    if not versions:
        raise ValueError("this database has no studies. Name that of the server with --data DIR or --database URL.")
    users = {one: [f"{row.key} {row.version}" for row in versions if one in row.source] for one in hashes}
    for column in (episodes.c.agent_0_sha256, episodes.c.agent_1_sha256, episodes.c.predictor_sha256):
        for played in connection.execute(select(column).where(column.in_(hashes)).distinct()).scalars():
            users[played] = users[played] or ["episodes"]
    return users


def _line(copy: "OwnCheckpoint", users: list[str]) -> str:
    return f"{copy.sha256[:12]}  {copy.kind:<10}{copy.size / _MB:>6.1f} MB  {', '.join(users) or 'unused'}"


def _summary(copies: "list[OwnCheckpoint]", unused: "list[OwnCheckpoint]", deleted: bool) -> str:
    def summed(some: "list[OwnCheckpoint]") -> str:
        word = "copy" if len(some) == 1 else "copies"
        return f"{len(some)} {word}, {sum(copy.size for copy in some) / _MB:.1f} MB"

    if deleted:
        return f"deleted: {summed(unused)}"
    return f"kept: {summed(copies)}; unused: {summed(unused)}{' (--delete-unused deletes them)' if unused else ''}"


def _refuse(error: Exception, status: int) -> int:
    print(f"kitchenmind study models: {error}", file=sys.stderr)
    return status
