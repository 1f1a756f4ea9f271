"""The differences between SQLite and PostgreSQL: connecting, locking out a second server, errors that mean "down"."""

import sqlite3
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import IO, Any, Final
from urllib.parse import quote

from sqlalchemy import Connection, Engine, create_engine, event, text
from sqlalchemy.engine import URL
from sqlalchemy.exc import DBAPIError
from sqlalchemy.pool import QueuePool

from server.store import database_file
from server.store.database_errors import DatabaseDown as DatabaseDown
from server.store.database_errors import DatabaseInUse as DatabaseInUse
from server.store.database_url import normal_url as normal_url
from server.store.database_url import shown as shown

BUSY_TIMEOUT_S = 30
# A server gives up a lock that somebody else holds sooner than a command does: a page waits for two such tries at most
# (one that is under way, and its own) before it tells the participant to try again.
SERVER_LOCK_TIMEOUT_S = 4
CONNECT_TIMEOUT_S = 5
STUCK_S = 5
# A PostgreSQL machine that vanished is noticed in seconds, not in the quarter of an hour that TCP would take.
_CONNECTING: Final = {
    "connect_timeout": CONNECT_TIMEOUT_S,
    "client_encoding": "utf8",  # whatever the server's default: its messages must be readable
    "keepalives_idle": 5,
    "keepalives_interval": 2,
    "keepalives_count": 3,
    "tcp_user_timeout": 10_000,
}
CHECKPOINT_PAGES = 16_000  # 64 MB: a checkpoint delays commits, so it should be rare
CACHE_KIB = 64 * 1024
_ADVISORY_LOCK = 0x6B69_7463_6865_6E01  # any constant will do, as long as it never changes
TURN_LOCK = 0x6B69_7463_6865_6E02
OVERWRITE = "overwrite deleted content"
ONE_WRITER = "SQLite takes one writing process: several need PostgreSQL."
_SQLITE_DOWN = {
    sqlite3.SQLITE_BUSY,
    sqlite3.SQLITE_LOCKED,
    sqlite3.SQLITE_NOMEM,
    sqlite3.SQLITE_READONLY,
    sqlite3.SQLITE_IOERR,
    sqlite3.SQLITE_CORRUPT,
    sqlite3.SQLITE_FULL,
    sqlite3.SQLITE_CANTOPEN,
    sqlite3.SQLITE_PROTOCOL,
    sqlite3.SQLITE_NOTADB,
}
# Connection lost, out of resources (disk full), stopped by an operator, system error, read only, lock, deadlock.
_POSTGRES_DOWN = ("08", "53", "57", "58", "25006", "55P03", "40")


def is_down(error: BaseException) -> bool:
    """Return whether the database is to blame (and the same call may succeed later), not the call."""
    if isinstance(error, DatabaseDown):
        return True
    if not isinstance(error, DBAPIError):
        return False
    original = error.orig
    if isinstance(original, sqlite3.Error):
        return getattr(original, "sqlite_errorcode", 0) & 0xFF in _SQLITE_DOWN
    if error.connection_invalidated:
        return True
    import psycopg  # here: who serves from SQLite does not wait for it

    if isinstance(original, psycopg.Error):
        if original.sqlstate is None:
            return isinstance(original, psycopg.OperationalError | psycopg.InterfaceError)
        return original.sqlstate.startswith(_POSTGRES_DOWN)
    return False


def translated(error: Exception) -> Exception:
    """Return DatabaseDown where the database is to blame, otherwise the error itself. The text contains no stored
    data."""
    if isinstance(error, DBAPIError) and is_down(error):
        return DatabaseDown(f"{type(error.orig).__name__}: {error.orig}")
    return error


def writer_engine(url: URL, lock_timeout_s: int = BUSY_TIMEOUT_S) -> Engine:
    """Return an engine with one connection that may write. SQLite: the only one that ever writes or checkpoints."""
    if url.get_backend_name() == "postgresql":
        options = {"options": f"-c synchronous_commit=on -c lock_timeout={lock_timeout_s}s", **_CONNECTING}
        return create_engine(url, pool_size=1, max_overflow=0, connect_args=options, hide_parameters=True)
    engine = create_engine(
        url,
        poolclass=QueuePool,
        pool_size=1,
        max_overflow=0,
        connect_args={"timeout": lock_timeout_s, "check_same_thread": False},
        hide_parameters=True,  # errors in the log must not contain participants' texts
    )
    _sqlite_settings(
        engine,
        "BEGIN IMMEDIATE",
        "PRAGMA journal_mode=WAL",
        "PRAGMA synchronous=FULL",  # with NORMAL, a power failure would lose the last commits
        "PRAGMA foreign_keys=ON",
        f"PRAGMA wal_autocheckpoint={CHECKPOINT_PAGES}",
        f"PRAGMA cache_size=-{CACHE_KIB}",
        "PRAGMA secure_delete=ON",  # what is deleted when a participant withdraws is overwritten
    )
    return engine


def reader(url: URL) -> Engine:
    """Return an engine whose connections cannot write: on SQLite opened read-only, on PostgreSQL in read-only
    transactions."""
    if url.get_backend_name() == "postgresql":
        settings = f"-c default_transaction_read_only=on -c lock_timeout={SERVER_LOCK_TIMEOUT_S}s"
        options = {"options": settings, **_CONNECTING}
        return create_engine(
            url,
            pool_size=4,
            pool_pre_ping=True,
            connect_args=options,
            isolation_level="REPEATABLE READ",
            hide_parameters=True,
        )
    readable = URL.create("sqlite", database=f"file:{quote(str(url.database))}", query={"mode": "ro", "uri": "true"})
    engine = create_engine(
        readable,
        poolclass=QueuePool,
        pool_size=4,
        connect_args={"timeout": BUSY_TIMEOUT_S, "check_same_thread": False},
        hide_parameters=True,
    )
    _sqlite_settings(engine, "BEGIN", "PRAGMA query_only=ON")
    return engine


def _sqlite_settings(engine: Engine, begin: str, *pragmas: str) -> None:
    """Send BEGIN explicitly: Python's driver would begin too late for a consistent view and end before a savepoint."""

    def connect(connection: Any, _: Any) -> None:
        connection.isolation_level = None
        for pragma in pragmas:
            connection.execute(pragma).close()

    event.listen(engine, "connect", connect)
    event.listen(engine, "begin", lambda connection: connection.exec_driver_sql(begin))


def overwrite_deleted(connection: Connection) -> None:
    """Let the end of this transaction remove what was deleted from SQLite's write-ahead log, too (Writer.transaction
    does it)."""
    connection.info[OVERWRITE] = True


class WriteConnection:
    """The one connection that writes, with the lock that keeps a second server out.

    Several processes of one server share that lock (PostgreSQL only). `in_turn`: their transactions follow one another,
    as those of one process do; the others must not mind what is written at the same time. Raises DatabaseInUse,
    DatabaseDown; ValueError for a PostgreSQL database that cannot hold every letter.
    """

    def __init__(
        self, url: URL, shared: bool = False, in_turn: bool = False, lock_timeout_s: int = SERVER_LOCK_TIMEOUT_S
    ) -> None:
        self._postgres = url.get_backend_name() == "postgresql"
        if shared and not self._postgres:
            raise ValueError(ONE_WRITER)
        self._try_lock = "pg_try_advisory_lock_shared" if shared else "pg_try_advisory_lock"
        # PostgreSQL lets go of a closed or killed server's lock in a moment, which may come after the next one starts.
        self._waits_s = [0.1] * 20 if shared else [0.05] * 20
        self._in_turn = in_turn
        self._made_lock = not self._postgres and not Path(f"{url.database}.lock").exists()
        path = Path(str(url.database))
        self._file: IO[str] | None = None if self._postgres else database_file.locked(path)
        self._opened = None if self._postgres else database_file.OpenedFile(path)
        self._engine = writer_engine(url, lock_timeout_s)
        self._connection: Connection | None = None
        try:
            self._connect()
        except BaseException:
            self.close()
            if self._made_lock and not Path(str(url.database)).exists():
                Path(f"{url.database}.lock").unlink(missing_ok=True)  # no trace of an address that does not work
            raise

    @contextmanager
    def transaction(self) -> Iterator[Connection]:
        """Commit at the end. After an error of the database the connection is made again."""
        if self._opened is not None:
            self._opened.check()  # before SQLite would make an empty database in its place
        connection = self._connection or self._connect()
        try:
            with connection.begin():
                if self._in_turn:
                    connection.execute(text("SELECT pg_advisory_xact_lock(:key)"), {"key": TURN_LOCK})
                yield connection
            if connection.info.get(OVERWRITE) and not self._postgres:
                empty_log(connection)
        except BaseException as error:
            if is_down(error):
                self._disconnect()
            raise

    def close(self) -> None:
        """Let the next server in."""
        self._disconnect()
        self._engine.dispose()
        if self._file is not None:
            self._file.close()

    def _connect(self) -> Connection:
        try:
            connection = self._engine.connect()
            if self._postgres and not self._locked(connection):
                connection.close()
                raise DatabaseInUse(f"another kitchenmind server uses {shown(self._engine.url)}. Stop it first.")
            if self._postgres:
                problem = encoding_problem(connection)
                if problem:
                    connection.close()
                    raise ValueError(problem)
            connection.rollback()
        except DBAPIError as error:
            raise translated(error) from error
        self._connection = connection
        return connection

    def _locked(self, connection: Connection) -> bool:
        """Return whether the lock is ours. Waits a moment for a server that has just stopped, or starts at the same
        time."""
        for wait_s in (*self._waits_s, None):
            if connection.execute(text(f"SELECT {self._try_lock}(:key)"), {"key": _ADVISORY_LOCK}).scalar_one():
                return True
            if wait_s is not None:
                time.sleep(wait_s)
        return False

    def _disconnect(self) -> None:
        connection, self._connection = self._connection, None
        if connection is not None:
            connection.invalidate()
            connection.close()


def encoding_problem(connection: Connection) -> str:
    """Return what is wrong with a PostgreSQL database made where no locale was set (SQL_ASCII) or for one language
    (LATIN1), and the remedy; empty: every letter can be stored."""
    encoding = connection.execute(text("SHOW server_encoding")).scalar_one()
    if encoding == "UTF8":
        return ""
    name = connection.engine.url.database
    remedy = f"Create it again: createdb --encoding UTF8 --template template0 {name}"
    return f"the database {name} keeps text as {encoding}, so not every name or answer could be stored. {remedy}"


def empty_log(connection: Connection) -> None:
    """Fold the log into the file and cut it to nothing. While somebody reads an older state it cannot: next time."""
    driver: Any = connection.connection.driver_connection
    (timeout_ms,) = driver.execute("PRAGMA busy_timeout").fetchone()
    driver.execute("PRAGMA busy_timeout=0").close()
    busy, _, _ = driver.execute("PRAGMA wal_checkpoint(TRUNCATE)").fetchone()
    driver.execute(f"PRAGMA busy_timeout={timeout_ms}").close()
    connection.info[OVERWRITE] = bool(busy)
