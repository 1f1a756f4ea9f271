"""PostgreSQL databases that tests use one after the other: putting the rows back takes a tenth of making a database."""

from collections.abc import Iterator
from contextlib import contextmanager

import psycopg
from psycopg.sql import SQL, Identifier

from tests.support.postgres_server import PostgresServer

# Whatever a test could change apart from rows: columns, indexes, constraints, triggers (also switched off), functions.
SCHEMA = """
    select array_agg(one order by one) from (
      select format('%s %s %s %s %s %s', relname, relkind, attname, atttypid, attnotnull, attisdropped) as one
      from pg_class join pg_attribute on attrelid = pg_class.oid
      where relnamespace = 'public'::regnamespace and attnum > 0
      union all select format('%s %s %s', tgrelid::regclass, tgenabled, pg_get_triggerdef(oid))
      from pg_trigger where not tgisinternal
      union all select format('%s %s', conrelid::regclass, pg_get_constraintdef(oid))
      from pg_constraint where connamespace = 'public'::regnamespace
      union all select pg_get_functiondef(oid) from pg_proc where pronamespace = 'public'::regnamespace
    ) as everything"""
OTHERS = "select pg_terminate_backend(pid) from pg_stat_activity where datname = current_database() and pid <> %s"
TABLES = "select tablename from pg_tables where schemaname = 'public' order by tablename"
SEQUENCES = "select sequencename, coalesce(last_value, 1), last_value is not null from pg_sequences"


class PostgresPool:
    """Copies of one database. `one()` gives a copy that has the rows of the original."""

    def __init__(self, server: PostgresServer, original: str) -> None:
        self._server, self._original = server, original
        self._free: list[str] = []
        with psycopg.connect(server.url(original)) as connection:
            self._schema = connection.execute(SCHEMA).fetchall()
            self._tables = [name for (name,) in connection.execute(TABLES)]
            self._rows = {name: rows for name in self._tables if (rows := _copied(connection, name))}
            self._sequences = connection.execute(SEQUENCES).fetchall()

    @contextmanager
    def one(self) -> Iterator[str]:
        """The address of a database that nobody else uses."""
        name = self._free.pop() if self._free else self._server.new_database(self._original)
        yield self._server.url(name)
        if self._restored(name):
            self._free.append(name)
        else:
            self._server.drop_database(name)

    def _restored(self, name: str) -> bool:
        """End all connections and put the rows back, unless more than rows was changed."""
        with psycopg.connect(self._server.url(name)) as connection:
            connection.execute(OTHERS, [connection.info.backend_pid])
            if connection.execute(SCHEMA).fetchall() != self._schema:
                return False
            connection.execute("set session_replication_role = replica")  # without triggers and foreign keys
            changed = [table for table in self._tables if table in self._rows or _has_rows(connection, table)]
            if changed:
                names = SQL(", ").join(map(Identifier, changed))
                connection.execute(SQL("truncate {} cascade").format(names))
            for table, rows in self._rows.items():
                with connection.cursor().copy(
                    SQL("copy {} from stdin (format binary)").format(Identifier(table))
                ) as copy:
                    copy.write(rows)
            for sequence, value, is_used in self._sequences:
                connection.execute("select setval(%s::regclass, %s, %s)", [sequence, value, is_used])
        return True


def _copied(connection: psycopg.Connection, table: str) -> bytes:
    """The rows of a table in PostgreSQL's binary format; nothing if there are none."""
    if not _has_rows(connection, table):
        return b""
    with connection.cursor().copy(SQL("copy {} to stdout (format binary)").format(Identifier(table))) as copy:
        return b"".join(copy)


def _has_rows(connection: psycopg.Connection, table: str) -> bool:
    found = connection.execute(SQL("select exists (select 1 from {})").format(Identifier(table))).fetchone()
    return bool(found and found[0])
