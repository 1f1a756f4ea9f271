"""The tables of what researchers make in the dashboard: kitchens."""

from sqlalchemy import Integer, Table, Text, UniqueConstraint

from server.store.columns import column, number, time
from server.store.table_base import KEY, metadata

kitchens = Table(
    "kitchens",
    metadata,
    number("Number of the saved kitchen."),
    column("name", KEY, meaning="The name by which studies use it."),
    column("version", Integer, meaning="Counts what was saved under this name, from 1."),
    column("grid", Text, nullable=True, meaning="The grid, one row a line; none: the kitchen was removed."),
    column("saved_by", KEY, meaning="The researcher who saved or removed it."),
    time("saved_at", "When."),
    UniqueConstraint("name", "version"),
)
