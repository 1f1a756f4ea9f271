"""Kitchens that researchers drew in the dashboard: every saved version, the newest one counts."""

from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path

from sqlalchemy import Connection, Row, func, inspect, select

from server.store.database import Database
from server.store.engines import normal_url
from server.store.tables import kitchens


@dataclass(frozen=True)
class StoredKitchen:
    """One version of a kitchen; `grid` is None where it was removed."""

    id: int
    name: str
    version: int
    grid: str | None
    saved_by: str
    saved_at: datetime


class KitchenConflict(Exception):
    """Somebody else has saved the kitchen since it was opened; `newest` is what they saved."""

    def __init__(self, newest: StoredKitchen) -> None:
        self.newest = newest
        super().__init__(f"{newest.saved_by} saved version {newest.version} of {newest.name} in the meantime")


def save(connection: Connection, name: str, grid: str | None, by: str, opened: int) -> StoredKitchen:
    """Add a version; `grid` None removes the kitchen. `opened`: the version that the change began with, 0 for a new
    kitchen. Raises KitchenConflict where that is no longer the newest; nothing is stored then."""
    newest = next(iter(of_name(connection, name)), None)
    version = newest.version if newest is not None else 0
    is_new = opened == 0 and (newest is None or newest.grid is None)  # a name is free again after a removal
    if newest is not None and opened != version and not is_new:
        raise KitchenConflict(newest)
    row = {"name": name, "version": version + 1, "grid": grid, "saved_by": by, "saved_at": datetime.now(UTC)}
    return _kitchen(connection.execute(kitchens.insert().values(row).returning(*kitchens.c)).one())


def newest(connection: Connection) -> list[StoredKitchen]:
    """Return the newest version of every kitchen that was not removed, by name."""
    last = select(func.max(kitchens.c.id)).group_by(kitchens.c.name)
    query = select(kitchens).where(kitchens.c.id.in_(last), kitchens.c.grid.is_not(None)).order_by(kitchens.c.name)
    return [_kitchen(row) for row in connection.execute(query)]


def of_name(connection: Connection, name: str) -> list[StoredKitchen]:
    """Return all versions of one kitchen, newest first."""
    query = select(kitchens).where(kitchens.c.name == name).order_by(kitchens.c.version.desc())
    return [_kitchen(row) for row in connection.execute(query)]


def grids(connection: Connection) -> dict[str, str]:
    """Return the grid of every kitchen by its name; none in a database from before there were kitchens."""
    if not inspect(connection).has_table(kitchens.name):
        return {}
    return {one.name: one.grid for one in newest(connection) if one.grid is not None}


def grids_at(url: str) -> dict[str, str]:
    """Return the `grids` of the database at an address, which a server may have open. None if there is no file yet.
    Raises DatabaseDown, ValueError."""
    wanted = normal_url(url)
    if wanted.get_backend_name() == "sqlite" and not Path(str(wanted.database)).is_file():
        return {}
    with Database(wanted.render_as_string(hide_password=False), read_only=True, readers=1) as database:
        return database.read_now(grids)


def _kitchen(row: "Row[tuple[object, ...]]") -> StoredKitchen:
    return StoredKitchen(**row._mapping)
