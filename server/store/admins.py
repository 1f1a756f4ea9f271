"""Researchers: their accounts and sessions. Stores only hashes of passwords and tokens."""

from dataclasses import dataclass
from datetime import UTC, datetime, timedelta

from sqlalchemy import Connection, delete, select, update

from server.store import attempts
from server.store.tables import ROLES, admin_sessions, admins

IDLE = timedelta(hours=2)
MAX_SESSION = timedelta(hours=12)  # a session ends then, even if it is in use
_SEEN_EVERY = timedelta(minutes=1)


@dataclass(frozen=True)
class Admin:
    """One account."""

    name: str
    role: str
    created_at: datetime


@dataclass(frozen=True)
class AdminSession:
    """The researcher of a session token, and whether conditions are hidden from them."""

    token_hash: str
    name: str
    role: str
    blind: bool

    def may(self, role: str) -> bool:
        """Return whether the account has the rights of `role`."""
        return ROLES.index(self.role) >= ROLES.index(role)


class NameTaken(ValueError):
    """There is an account of this name."""

    def __init__(self, name: str) -> None:
        super().__init__(f"there is an account {name!r} already. A new password: kitchenmind admin reset {name}")


def create(connection: Connection, name: str, password_hash: str, role: str) -> None:
    """Create an account. Raises NameTaken, ValueError for an unknown role."""
    _check_role(role)
    if password_hash_of(connection, name) is not None:
        raise NameTaken(name)
    row = {"name": name, "password_hash": password_hash, "role": role, "created_at": datetime.now(UTC)}
    connection.execute(admins.insert().values(row))


def _check_role(role: str) -> None:
    if role not in ROLES:
        raise ValueError(f"{role!r} is not a role. Choose from {', '.join(ROLES)}.")


def every(connection: Connection) -> list[Admin]:
    """Return all accounts, by name."""
    query = select(admins.c.name, admins.c.role, admins.c.created_at).order_by(admins.c.name)
    return [Admin(*row) for row in connection.execute(query)]


def password_hash_of(connection: Connection, name: str) -> str | None:
    """Return what to check a password against; None: no such account."""
    return connection.execute(select(admins.c.password_hash).where(admins.c.name == name)).scalar_one_or_none()


def set_password(connection: Connection, name: str, password_hash: str) -> bool:
    """End all sessions of the account too, and let it sign in at once whatever was tried. False: no such account."""
    query = update(admins).where(admins.c.name == name).values(password_hash=password_hash)
    attempts.forget(connection, name)
    close_all(connection, name)
    return connection.execute(query).rowcount == 1


def set_role(connection: Connection, name: str, role: str) -> bool:
    """Give an account another role and sign it out everywhere, as an open session may show what the new role may not
    see. False: no such account. Raises ValueError for an unknown role."""
    _check_role(role)
    close_all(connection, name)
    return connection.execute(update(admins).where(admins.c.name == name).values(role=role)).rowcount == 1


def remove(connection: Connection, name: str) -> bool:
    """Delete the account; what it did stays in the audit log. False: no such account."""
    close_all(connection, name)
    attempts.forget(connection, name)
    return connection.execute(delete(admins).where(admins.c.name == name)).rowcount == 1


# Sessions


def open_session(connection: Connection, name: str, token_hash: str, now: datetime) -> None:
    """Start a session with this token, in blind mode. Expired sessions are deleted."""
    old = (admin_sessions.c.created_at < now - MAX_SESSION) | (admin_sessions.c.seen_at < now - IDLE)
    connection.execute(delete(admin_sessions).where(old))
    row = {"token_hash": token_hash, "admin": name, "blind": True, "created_at": now, "seen_at": now}
    connection.execute(admin_sessions.insert().values(row))


def session(connection: Connection, token_hash: str, now: datetime) -> tuple[AdminSession, bool] | None:
    """Return the session of this token, and whether `touch` is due; None if it has ended."""
    query = select(admin_sessions, admins.c.role).join_from(admin_sessions, admins)
    row = connection.execute(query.where(admin_sessions.c.token_hash == token_hash)).first()
    # Without a sign: a session from the future would never end, if the machine's clock was set back since then.
    if row is None or abs(now - row.created_at) > MAX_SESSION or abs(now - row.seen_at) > IDLE:
        return None
    return AdminSession(token_hash, row.admin, row.role, row.blind), abs(now - row.seen_at) > _SEEN_EVERY


def touch(connection: Connection, token_hash: str, now: datetime) -> None:
    """Note that the session was used."""
    connection.execute(update(admin_sessions).where(admin_sessions.c.token_hash == token_hash).values(seen_at=now))


def close_session(connection: Connection, token_hash: str) -> None:
    """End the session with this token."""
    connection.execute(delete(admin_sessions).where(admin_sessions.c.token_hash == token_hash))


def close_all(connection: Connection, name: str) -> None:
    """Sign an account out everywhere."""
    connection.execute(delete(admin_sessions).where(admin_sessions.c.admin == name))


def set_blind(connection: Connection, token_hash: str, blind: bool) -> None:
    """Set whether conditions are hidden in this session."""
    connection.execute(update(admin_sessions).where(admin_sessions.c.token_hash == token_hash).values(blind=blind))
