"""`kitchenmind study delete`: delete all data of a study, such as at the end of its retention period. Imports are
inside functions, so that --help is quick.
"""

import argparse
import contextlib
import sys
import time
from typing import TYPE_CHECKING

from server.commands.server_data import ServerData, add_data_options

if TYPE_CHECKING:
    from sqlalchemy import URL

    from server.store.study_deletion import StudyData

_SERVERS_TURN_S = 0.1  # SQLite's longest wait between two tries for a lock, so a server gets it next
_KEPT = """Kept: the versions of the study, its drafts, openings and pauses, the audit log, and a tombstone of each
participant, so that an import of an older export leaves them out.
Not touched: copies made with `kitchenmind backup` or pg_dump, and exports. Delete them too. After restoring an older
copy, delete the study's data again."""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("name", metavar="NAME", help="the study's name; all its versions are meant")
    parser.add_argument("--reason", required=True, metavar="TEXT", help="reason for the audit log; do not name persons")
    parser.add_argument("--yes", action="store_true", help="do not ask for the study's name as confirmation")
    add_data_options(parser)


def run(arguments: argparse.Namespace) -> int:
    """Return 0 if done, 2 for wrong input or without confirmation, 1 if the database failed."""
    from sqlalchemy.exc import DBAPIError

    from server.commands.databases import open_stored
    from server.store import study_deletion
    from server.store.engines import DatabaseDown, shown
    from server.store.migrate import DatabaseTooNew

    try:
        if not arguments.reason.strip():
            raise ValueError("the reason is empty. Give the audit log one, such as --reason 'retention period ended'")
        with open_stored(ServerData.of(arguments).url) as database:
            data = database.read_now(study_deletion.data_of, arguments.name)
            url = database.url
        if data.is_empty:
            print(f"{data.study} has no data in {shown(url)}; nothing to delete")
            return 0
        print(_summary(data, shown(url)))
        # Asked before the first transaction: nothing is locked while the user decides.
        if not arguments.yes and not _confirmed(data.study):
            raise ValueError("nothing was deleted. Type the study's name when asked, or give --yes")
        _delete(url, data, arguments.reason)
    except (ValueError, DatabaseTooNew) as error:
        return _refuse(str(error), 2)
    except (DatabaseDown, DBAPIError, OSError) as error:
        return _refuse(f"{error}\nWhat was deleted so far stays deleted. Repeat the command to delete the rest.", 1)
    print(f"deleted: all data of {data.study}\n{_KEPT}")
    if url.get_backend_name() == "postgresql":
        print("PostgreSQL: the deleted content leaves the files with the next VACUUM.")
    return 0


def _summary(data: "StudyData", where: str) -> str:
    versions = f"{data.versions} version{'s' * (data.versions != 1)}"
    lines = [f"{data.study} ({versions}) in {where}. All of this will be deleted:"]
    lines += [f"  {number:>8}  {words}" for words, number in data.counts.items()]
    return "\n".join(
        [*lines, "with every timestep, input, pause, event and exclusion of the episodes and participants"]
    )


def _confirmed(study: str) -> bool:
    if not sys.stdin.isatty():
        return False
    return input("This cannot be undone. Type the study's name to delete its data: ").strip() == study


def _delete(url: "URL", data: "StudyData", reason: str) -> None:
    from server.store import engines, study_deletion
    from server.store.concurrent_changes import alongside_server
    from server.store.migrate import migrate

    served = True
    with contextlib.suppress(engines.DatabaseInUse):  # the server has it open, so its tables exist
        migrate(url.render_as_string(hide_password=False))
        served = False
    with alongside_server(url) as connection:
        study_deletion.begin(connection, data, served, reason)
    for participant_id in data.participants:
        with alongside_server(url) as connection:
            study_deletion.delete_participant(connection, participant_id)
        if served:
            time.sleep(_SERVERS_TURN_S)
    with alongside_server(url) as connection:
        study_deletion.finish(connection, data.study)


def _refuse(text: str, status: int) -> int:
    print(f"kitchenmind study delete: {text}", file=sys.stderr)
    return status
