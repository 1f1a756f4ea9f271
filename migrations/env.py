"""Connect Alembic to the database: through the connection of server.store.migrate, or KITCHENMIND_DATABASE."""

import os
from typing import Literal

from alembic import context
from sqlalchemy import Connection

from server.store import engines
from server.store.columns import UtcDateTime
from server.store.tables import metadata


def plain_types(kind: str, thing: object, _: object) -> str | Literal[False]:
    """Name the database's own types in revisions, so that they never change with our code."""
    return "sa.DateTime(timezone=True)" if kind == "type" and isinstance(thing, UtcDateTime) else False


def migrate(connection: Connection) -> None:
    context.configure(
        connection=connection,
        target_metadata=metadata,
        render_as_batch=connection.dialect.name == "sqlite",
        compare_type=True,
        render_item=plain_types,
    )
    with context.begin_transaction():
        context.run_migrations()


given = context.config.attributes.get("connection")
if given is not None:
    migrate(given)
else:
    url = engines.normal_url(os.environ.get("KITCHENMIND_DATABASE", "sqlite:///kitchenmind.db"))
    with engines.WriteConnection(url).transaction() as opened:
        migrate(opened)
