"""`kitchenmind admin`: researchers' accounts. Works while the server runs. Imports are inside functions, so that --help
is quick.
"""

import argparse
import contextlib
import getpass
import re
import secrets
import sys
from collections.abc import Callable
from typing import TYPE_CHECKING, Any, TypeVar

from server.commands.server_data import ServerData, add_data_options

if TYPE_CHECKING:
    from sqlalchemy import Connection

T = TypeVar("T")
_RIGHTS = "watch: see; act: also intervene; own: also accounts, kitchens and studies"
_ROLE_NAMES = ("watch", "act", "own")


def add_arguments(parser: argparse.ArgumentParser) -> None:
    add_data_options(parser)
    verbs = parser.add_subparsers(dest="admin_verb", required=True, metavar="create|role|reset|remove|list")
    create = verbs.add_parser("create", help="create an account; asks for a password, or makes one")
    create.add_argument("name", help="the name to sign in with")
    create.add_argument("--role", choices=_ROLE_NAMES, default="own", help=f"{_RIGHTS} (own)")
    role = verbs.add_parser("role", help="give an account another role and sign it out everywhere")
    role.add_argument("name", help="the account")
    role.add_argument("role", choices=_ROLE_NAMES, help=_RIGHTS)
    reset = verbs.add_parser("reset", help="set a new password and sign the account out everywhere")
    reset.add_argument("name", help="the account")
    remove = verbs.add_parser("remove", help="delete an account; the audit log keeps its actions")
    remove.add_argument("name", help="the account")
    accounts = verbs.add_parser("list", help="list all accounts")
    for each in (create, role, reset, remove, accounts):
        add_data_options(each, default=argparse.SUPPRESS)


def run(arguments: argparse.Namespace) -> int:
    """Return 0 if done, 2 for wrong input, 1 if the database failed."""
    from sqlalchemy.exc import DBAPIError

    from server.store import engines
    from server.store.migrate import DatabaseTooNew, migrate

    try:
        url = ServerData.of(arguments).url
        with contextlib.suppress(engines.DatabaseInUse):  # the server has it open, so its tables exist
            migrate(url)
        sys.stdout.writelines(f"{line}\n" for line in _do(Accounts(url), arguments))
    except (ValueError, DatabaseTooNew) as error:
        return _refuse(error, 2)
    except (EOFError, KeyboardInterrupt):
        return _refuse(ValueError("no password was given, nothing was changed"), 2)
    except (engines.DatabaseDown, DBAPIError, OSError) as error:
        return _refuse(error, 1)
    return 0


class Accounts:
    """The accounts in a database. A transaction is open only while it reads or writes, never while the user types."""

    def __init__(self, url: str) -> None:
        self._url = url

    def read(self, function: Callable[..., T], *args: Any) -> T:
        """Run a function that reads; return its result."""
        from server.store.database import Database

        with Database(self._url, read_only=True, readers=1) as database:
            return database.read_now(function, *args)

    def write(self, function: Callable[..., T], *args: Any) -> T:
        """Run the function in one transaction, while a server has the database open."""
        from server.store import engines

        engine = engines.writer_engine(engines.normal_url(self._url))
        try:
            with engine.begin() as connection:
                return function(connection, *args)
        finally:
            engine.dispose()


def _do(accounts: Accounts, arguments: argparse.Namespace) -> list[str]:
    """Carry out the command; return the text to print."""
    from server.store import admins

    verb = arguments.admin_verb
    if verb == "list":
        rows = accounts.read(admins.every)
        return [f"{admin.name:<24}{admin.role:<8}{admin.created_at:%Y-%m-%d}" for admin in rows]
    name = _checked(arguments.name)
    there = accounts.read(admins.password_hash_of, name) is not None
    if verb == "create" and there:
        raise admins.NameTaken(name)
    if verb != "create" and not there:
        raise _nobody(name)
    if verb == "remove":
        accounts.write(_change, verb, {"name": name}, lambda connection: admins.remove(connection, name))
        return [f"{name}: removed"]
    if verb == "role":
        detail = {"name": name, "role": arguments.role}
        accounts.write(_change, verb, detail, lambda connection: admins.set_role(connection, name, arguments.role))
        return [f"{name}: has the role {arguments.role}, and signs in again"]
    from server.web.passwords import hashed

    password, made = _password(name)
    stored = hashed(password)
    detail = {"name": name}
    if verb == "create":
        accounts.write(
            _change, verb, detail, lambda connection: admins.create(connection, name, stored, arguments.role)
        )
    else:
        accounts.write(_change, verb, detail, lambda connection: admins.set_password(connection, name, stored))
    return [f"{name}: can sign in at /admin", *([f"password: {password}\nIt is not shown again."] if made else [])]


def _change(
    connection: "Connection", verb: str, detail: dict[str, str], change: "Callable[[Connection], bool | None]"
) -> None:
    """Change an account and add the audit entry. Raises ValueError if the account was deleted in the meantime."""
    from server.store import audit

    if change(connection) is False:
        raise _nobody(detail["name"])
    audit.add(connection, "command line", f"admin {verb}", detail)


def _nobody(name: str) -> ValueError:
    return ValueError(f"there is no account {name!r}. See them with: kitchenmind admin list")


def _checked(name: str) -> str:
    if not re.fullmatch(r"[\w.@-]{1,64}", name):
        raise ValueError(f"{name!r} cannot name an account. Use letters, digits and . _ - @ without spaces.")
    return name


def _password(name: str) -> tuple[str, bool]:
    """Return the password that the user types twice, or a generated one; and whether it was generated."""
    typed = getpass.getpass("Password (empty: make one): ") if sys.stdin.isatty() else ""
    if not typed:
        return secrets.token_urlsafe(15), True
    from server.web.passwords import weakness

    weak = weakness(typed, name)
    if weak is not None:
        raise ValueError(f"not this password: {weak}. Leave it empty to generate one.")
    if getpass.getpass("Again: ") != typed:
        raise ValueError("the two passwords differ, so nothing was changed. Repeat the command.")
    return typed, False


def _refuse(error: Exception, status: int) -> int:
    print(f"kitchenmind admin: {error}", file=sys.stderr)
    return status
