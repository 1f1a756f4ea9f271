"""`kitchenmind admin`: researchers' accounts. Works while the server runs. Imports late."""

import argparse
import contextlib
import getpass
import re
import secrets
import sys
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from sqlalchemy import Connection

_ROLES = "watch: see; act: also step in; own: also accounts"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("--database", metavar="URL", help="sqlite:///path or postgresql://user@host/name")
    verbs = parser.add_subparsers(dest="admin_verb", required=True, metavar="create|reset|remove|list")
    create = verbs.add_parser("create", help="a new account; asks for a password, or makes one")
    create.add_argument("name")
    _add_database(create)
    create.add_argument("--role", choices=("watch", "act", "own"), default="own", help=f"{_ROLES} (own)")
    reset = verbs.add_parser("reset", help="a new password; signs the account out everywhere")
    reset.add_argument("name")
    _add_database(reset)
    remove = verbs.add_parser("remove", help="deletes an account; the audit log keeps what it did")
    remove.add_argument("name")
    _add_database(remove)
    _add_database(verbs.add_parser("list", help="all accounts"))


def _add_database(parser: argparse.ArgumentParser) -> None:
    """The option also after the verb, where other commands have it; before it, it keeps what was given there."""
    parser.add_argument("--database", metavar="URL", default=argparse.SUPPRESS, help="sqlite:///path or postgresql://")


def run(arguments: argparse.Namespace) -> int:
    """0 done; 2 wrong input; 1 the database failed."""
    from sqlalchemy.exc import DBAPIError

    from server.settings import Settings
    from server.store import engines
    from server.store.migrate import DatabaseTooNew, migrate

    url = arguments.database or Settings().database
    try:
        with contextlib.suppress(engines.DatabaseInUse):  # the server has it open, so its tables are there
            migrate(url)
        engine = engines.writer_engine(engines.normal_url(url))
        try:
            with engine.begin() as connection:
                return _do(connection, arguments)
        finally:
            engine.dispose()
    except (ValueError, DatabaseTooNew) as error:
        return _refuse(error, 2)
    except (engines.DatabaseDown, DBAPIError, OSError) as error:
        return _refuse(error, 1)


def _do(connection: "Connection", arguments: argparse.Namespace) -> int:
    from server.store import admins, audit

    verb = arguments.admin_verb
    if verb == "list":
        for admin in admins.every(connection):
            print(f"{admin.name:<24}{admin.role:<8}{admin.created_at:%Y-%m-%d}")
        return 0
    name = _checked(arguments.name)
    if verb == "remove":
        found = admins.remove(connection, name)
    else:
        from server.web.passwords import hashed

        password, made = _password(name)
        if verb == "create":
            admins.create(connection, name, hashed(password), arguments.role)
            found = True
        else:
            found = admins.set_password(connection, name, hashed(password))
    if not found:
        raise ValueError(f"there is no account {name!r}. See them with: kitchenmind admin list")
    audit.add(connection, "command line", f"admin {verb}", {"name": name})
    print(f"{name}: {'removed' if verb == 'remove' else 'can sign in at /admin'}")
    if verb != "remove" and made:
        print(f"password: {password}\nIt is not shown again.")
    return 0


def _checked(name: str) -> str:
    if not re.fullmatch(r"[\w.@-]{1,64}", name):
        raise ValueError(f"{name!r} cannot name an account. Use letters, digits and . _ - @ without spaces.")
    return name


def _password(name: str) -> tuple[str, bool]:
    """The password that somebody types twice, or one that is made; and whether it was made."""
    typed = getpass.getpass("Password (empty: make one): ") if sys.stdin.isatty() else ""
    if not typed:
        return secrets.token_urlsafe(15), True
    from server.web.passwords import weakness

    weak = weakness(typed, name)
    if weak is not None:
        raise ValueError(f"not this password: {weak}. An empty one makes a good one.")
    if getpass.getpass("Again: ") != typed:
        raise ValueError("the two were not the same")
    return typed, False


def _refuse(error: Exception, status: int) -> int:
    print(f"kitchenmind admin: {error}", file=sys.stderr)
    return status
