"""The address of the database in settings and commands: parse it, complete it, show it without the password."""

from pathlib import Path

from sqlalchemy.engine import URL, make_url
from sqlalchemy.exc import ArgumentError

_ADDRESSES = "Use sqlite:///file.db or postgresql://user@host/name."
_IN_PASSWORDS = "In a password, write / as %2F, @ as %40 and : as %3A."


def normal_url(url: str) -> URL:
    """Return the address with its driver. Raises ValueError for one that is neither SQLite in a file nor PostgreSQL."""
    try:
        parsed = make_url(url)
    except (ArgumentError, ValueError):  # their texts, and the address itself, may hold a password
        raise ValueError(f"the database address cannot be understood. {_ADDRESSES} {_IN_PASSWORDS}") from None
    backend = parsed.get_backend_name()
    if backend == "postgresql":
        if "@" in f"{parsed.host or ''}{parsed.database or ''}":  # then a piece of the password was read as the host
            raise ValueError(f"the database address has more than one @. {_ADDRESSES} {_IN_PASSWORDS}")
        return parsed.set(drivername="postgresql+psycopg")
    if backend != "sqlite":
        raise ValueError(f"{backend} is not supported. {_ADDRESSES}")
    return _sqlite_url(parsed, url)


def _sqlite_url(parsed: URL, written: str) -> URL:
    """Return the address of a SQLite file, without anything that SQLAlchemy would drop or SQLite would not open."""
    if parsed.host is not None or parsed.username is not None:
        meant = f"sqlite:///{written.partition('://')[2]}"
        raise ValueError(f"{written} has two slashes. Write {meant} (three), or four before an absolute path.")
    if "?" in written:
        raise ValueError(f"{written}: a ? ends the name of the file. Write %3F if it is part of the name.")
    if parsed.database in (None, "", ":memory:"):
        raise ValueError("a database in memory would lose every game. Use sqlite:///file.db.")
    path = Path(str(parsed.database)).absolute()
    if path.is_dir():
        raise ValueError(f"{path} is a folder. Give a file in it: sqlite:///{parsed.database.rstrip('/')}/file.db.")
    return parsed.set(drivername="sqlite", database=str(path))


def shown(url: URL) -> str:
    """Return an address as messages may show it: without a password, wherever it stands."""
    return url.difference_update_query([name for name in url.query if "pass" in name.lower()]).render_as_string()
