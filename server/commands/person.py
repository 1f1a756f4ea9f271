"""`kitchenmind person`: find or delete one participant on request. Works while the server runs."""

import argparse
import contextlib
import sys
from typing import TYPE_CHECKING

from server.commands.server_data import ServerData, add_data_options

if TYPE_CHECKING:
    from sqlalchemy import URL, Connection

    from server.store.participants import Participant


def add_arguments(parser: argparse.ArgumentParser) -> None:
    verbs = parser.add_subparsers(dest="person_verb", required=True, metavar="find|delete")
    find = verbs.add_parser("find", help="show number, participant id and status")
    delete = verbs.add_parser("delete", help="delete everything about one participant")
    for each in (find, delete):
        each.add_argument("who", metavar="WHO", help="the personal code, the recruiter's id, or the participant id")
        each.add_argument("--study", required=True, metavar="KEY", help="the study's name")
        add_data_options(each)
    delete.add_argument(
        "--reason", required=True, metavar="TEXT", help="reason for the audit log; do not name the person"
    )
    delete.add_argument("--yes", action="store_true", help="do not ask for confirmation")


def run(arguments: argparse.Namespace) -> int:
    """Return 0 if done, 2 for wrong input or without confirmation, 1 if the database failed."""
    from sqlalchemy.exc import DBAPIError

    from server.commands.databases import open_stored
    from server.store import participants
    from server.store.engines import DatabaseDown
    from server.store.migrate import DatabaseTooNew

    try:
        with open_stored(ServerData.of(arguments).url) as database:
            found = database.read_now(_find, arguments)
            url = database.url
        who = participants.label(found.number, found.simulated)
        print(f"{who} of {arguments.study}: participant id {found.id}, {found.status}")
        if arguments.person_verb == "find":
            return 0
        # Asked before the transaction: nothing is locked while the user decides.
        if not arguments.yes and not _confirmed():
            raise ValueError("nothing was deleted. Answer yes, or give --yes")
        _delete(url, found, arguments)
    except (ValueError, DatabaseTooNew) as error:
        return _refuse(error, 2)
    except (DatabaseDown, DBAPIError, OSError) as error:
        return _refuse(error, 1)
    print("deleted; only the count of withdrawals is kept")
    return 0


def _find(connection: "Connection", arguments: argparse.Namespace) -> "Participant":
    from server.store import participants, studies

    versions = studies.known_ids(connection, arguments.study)
    found = participants.find(connection, versions, arguments.who.strip())
    if found is None:
        raise ValueError(
            f"{arguments.study} has no participant with the id or code {arguments.who!r}. Look it up on the page of "
            "the participant in the dashboard. The data of people who withdrew are deleted already."
        )
    return found


def _confirmed() -> bool:
    if not sys.stdin.isatty():
        return False
    return input("Delete everything about this participant? This cannot be undone. Type yes: ").strip() == "yes"


def _delete(url: "URL", found: "Participant", arguments: argparse.Namespace) -> None:
    from server.store import engines, overview
    from server.store.concurrent_changes import alongside_server
    from server.store.migrate import migrate
    from server.store.tables import participants
    from server.store.withdrawal import Deletion, withdraw

    with contextlib.suppress(engines.DatabaseInUse):  # the server has it open, so its tables exist
        migrate(url.render_as_string(hide_password=False))
    deletion = Deletion("command line", "delete participant", {"study": arguments.study, "reason": arguments.reason})
    with alongside_server(url) as connection:
        playing = overview.playing(connection, participants.c.id == found.id)
        if playing:
            raise ValueError(f"{playing[0]} is in a game now. Wait, or use the dashboard, which ends the game first")
        if not withdraw(connection, found.id, deletion):
            raise ValueError("the participant was deleted a moment ago, so nothing is left to delete")


def _refuse(error: Exception, status: int) -> int:
    print(f"kitchenmind person: {error}", file=sys.stderr)
    return status
