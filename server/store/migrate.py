"""Brings a database to the tables of this version, or makes a new one. `kitchenmind serve` runs it first."""

from contextlib import suppress
from pathlib import Path

from alembic import command
from alembic.config import Config
from alembic.migration import MigrationContext
from alembic.script import ScriptDirectory
from alembic.util import CommandError
from sqlalchemy import Connection
from sqlalchemy.exc import DBAPIError

from server.store import engines
from server.store.database import Database
from server.store.engines import DatabaseDown

MIGRATIONS = Path(__file__).resolve().parents[2] / "migrations"


class DatabaseTooNew(Exception):
    """The database was written by a later version of this software."""


def migrate(url: str) -> None:
    """Creates or upgrades the tables. Raises DatabaseInUse, DatabaseDown, DatabaseTooNew, ValueError (bad address)."""
    config = Config()
    config.set_main_option("script_location", str(MIGRATIONS).replace("%", "%%"))
    writer = engines.Writer(engines.normal_url(url))
    try:
        with writer.transaction() as connection:
            config.attributes["connection"] = connection
            command.upgrade(config, "head")
    except CommandError as error:
        raise DatabaseTooNew(f"{error}. Use the kitchenmind that made this database, or a later one.") from None
    except DBAPIError as error:
        raise engines.translated(error) from error
    finally:
        writer.close()


def migrate_shared(url: str) -> None:
    """`migrate` for one of several processes: tables that are of this version already are left to those at work."""
    with suppress(DatabaseDown), Database(url, read_only=True, readers=1) as database:
        if database.read_now(revision_of) == newest_revision():
            return
    migrate(url)


def revision_of(connection: Connection) -> str | None:
    """Which revision a database's tables are of."""
    return MigrationContext.configure(connection).get_current_revision()


def known_revisions() -> tuple[str, ...]:
    """Every revision that this version knows, newest first."""
    return tuple(script.revision for script in ScriptDirectory(str(MIGRATIONS)).walk_revisions())


def newest_revision() -> str:
    """The revision that `migrate` leads to."""
    return str(ScriptDirectory(str(MIGRATIONS)).get_current_head())
