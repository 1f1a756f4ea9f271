"""Let a command change a database that a server may have open at the same time."""

from collections.abc import Iterator
from contextlib import contextmanager

from sqlalchemy import URL, Connection, text

from server.store.engines import OVERWRITE, TURN_LOCK, empty_log, writer_engine


@contextmanager
def alongside_server(url: URL) -> Iterator[Connection]:
    """Open a transaction of a command, whether or not a server has the database open. Do not wait for user input
    inside."""
    engine = writer_engine(url)
    try:
        with engine.connect() as connection:
            with connection.begin():
                if url.get_backend_name() == "postgresql":
                    connection.execute(text("SELECT pg_advisory_xact_lock(:key)"), {"key": TURN_LOCK})
                yield connection
            if connection.info.get(OVERWRITE) and url.get_backend_name() == "sqlite":
                empty_log(connection)
    finally:
        engine.dispose()
