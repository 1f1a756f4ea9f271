"""Open a command's database for reading only: the server may keep running."""

from pathlib import Path

from sqlalchemy import inspect

from server.participation.own_kitchens import load_with_kitchens
from server.settings import Settings, own_models_here
from server.store.database import Database, DatabaseDown
from server.store.engines import normal_url, shown
from server.store.kitchens import grids_at
from server.study.loader import StudyError, StudyFile


def open_stored(url: str | None) -> Database:
    """Open the database at `url`, or the one in the settings. Raises ValueError with the remedy if there is none."""
    wanted = normal_url(url or Settings().database)
    named = shown(wanted)
    if wanted.get_backend_name() == "sqlite" and not Path(str(wanted.database)).is_file():
        raise ValueError(f"there is no database {wanted.database}. Give the right one with --database sqlite:///path.")
    database = Database(wanted.render_as_string(hide_password=False), read_only=True)
    try:
        has_tables = database.read_now(lambda connection: inspect(connection).has_table("ticks"))
    except DatabaseDown as error:
        database.close()
        raise ValueError(f"cannot read {named}: {error}") from None
    if not has_tables:
        database.close()
        raise ValueError(f"{named} is not a kitchenmind database. Give the right one with --database.")
    return database


def load_stored(path: Path) -> StudyFile:
    """Return the study in a file, with the kitchens and trained models of the server that these settings describe.
    Raises StudyError, OSError."""
    return load_with_kitchens(path, stored_kitchens, own_models=own_models_here())


def stored_kitchens() -> dict[str, str]:
    """Read the grids of the kitchens that were drawn in the dashboard, from the database in the settings. Raises
    StudyError if it cannot be read."""
    url = Settings().database
    try:
        return grids_at(url)
    except (DatabaseDown, ValueError) as error:
        where = shown(normal_url(url))
        reason = f"the kitchens of the dashboard cannot be read ({error})"
        raise StudyError([f"{where}: {reason}. Set KITCHENMIND_DATABASE."]) from None
