"""Check passwords and completion codes with protection against guessing.

A try is reserved in the database before anything is awaited on its behalf, so parallel requests and several server
processes share one limit, and it is given back if it was right. The limit is for one name from one origin. Nobody else
can use it up, and a browser that was signed in before has an origin of its own.

Not the library `limits`: it cannot count in our database, in the transaction that reserves a try, and cannot give one
try back.
"""

import asyncio
import hmac
import secrets
from collections import Counter
from collections.abc import Awaitable, Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from datetime import UTC, datetime
from hashlib import sha256
from typing import Final

from fastapi import Response
from starlette.requests import HTTPConnection

from server.store import attempts
from server.store.attempts import Reserved
from server.web.auth import cookie_name
from server.web.client_address import address_of
from server.web.dependencies import Web
from server.web.passwords import is_right

PASSWORD: Final = "password"  # noqa: S105 - the name of a kind
PASSWORD_OF_KNOWN: Final = "password, known browser"  # noqa: S105 - the name of a kind
CODE: Final = "completion code"
BROWSER: Final = "browser"
BROWSER_PATH: Final = "/admin/login"
BROWSER_S: Final = 180 * 24 * 3600
AT_ONCE: Final = 2  # each check of a password takes 64 MiB
MAX_WAITING: Final = 64
MAX_WAITING_OF_ONE: Final = 32


class Busy(Exception):
    """Too many passwords wait to be checked."""


@dataclass(frozen=True)
class Origin:
    """The origin of a try: its `kind`, and a keyed hash of the address or the known browser."""

    kind: str
    id: str


class Hashing:
    """The queue of passwords that are checked. One for each application."""

    def __init__(self) -> None:
        self._at_once = asyncio.Semaphore(AT_ONCE)
        self._waiting: Counter[Origin] = Counter()

    @contextmanager
    def place(self, origin: Origin) -> Iterator[None]:
        """Hold a place in the queue. Raises Busy. Unknown browsers cannot take the places of known browsers."""
        of_unknown = sum(count for who, count in self._waiting.items() if who.kind != PASSWORD_OF_KNOWN)
        full = origin.kind != PASSWORD_OF_KNOWN and of_unknown >= MAX_WAITING
        if full or self._waiting[origin] >= MAX_WAITING_OF_ONE:
            raise Busy
        self._waiting[origin] += 1
        try:
            yield
        finally:
            self._waiting[origin] -= 1
            if not self._waiting[origin]:
                del self._waiting[origin]

    async def is_right(self, password: str, stored: str | None) -> bool:
        """Check a password in a thread, at most AT_ONCE of them at the same time."""
        async with self._at_once:
            return await asyncio.to_thread(is_right, password, stored)


@dataclass(frozen=True)
class GuessOutcome:
    """The result of a try. `left`: tries that remain; None: it was not checked, as there was none left."""

    right: bool
    left: int | None


async def guarded(web: Web, origin: Origin, name: str, check: Callable[[], Awaitable[bool]]) -> GuessOutcome:
    """Reserve a try, run the check, and give the try back if the check succeeded or could not be made."""
    now = datetime.now(UTC)
    reserved = await web.database.write(attempts.reserve, origin.kind, name, origin.id, now)
    if reserved is None:
        return GuessOutcome(False, None)
    try:
        right = await check()
    except Exception:
        await _give_back(web, reserved)
        raise
    if right:
        await _give_back(web, reserved)
    return GuessOutcome(right, reserved.left)


async def _give_back(web: Web, reserved: Reserved) -> None:
    await web.database.write(attempts.release, reserved)


def origin_of_address(web: Web, connection: HTTPConnection, kind: str) -> Origin:
    """Return the origin of a client identified by its address only."""
    return Origin(kind, keyed(web, "address", address_of(connection)))


def keyed(web: Web, *parts: str) -> str:
    """Return a hash that cannot be computed without our secret."""
    return hmac.new(web.csrf.secret, "\n".join(parts).encode(), sha256).hexdigest()


# Known browsers. The mark gives nothing but tries of its own; a new password makes it worthless.


def known_browser(web: Web, connection: HTTPConnection, name: str, stored: str | None) -> Origin | None:
    """Return the origin of a browser in which this account was signed in with its present password, or None."""
    made, _, seal = connection.cookies.get(cookie_name(BROWSER, web.csrf.secure), "")[:200].partition(".")
    if stored is None or not hmac.compare_digest(seal.encode(), _seal(web, made, name, stored).encode()):
        return None
    return Origin(PASSWORD_OF_KNOWN, keyed(web, "browser", made))


def remember_browser(web: Web, response: Response, name: str, stored: str) -> None:
    """Mark the browser that has just signed in."""
    made = secrets.token_hex(16)
    response.set_cookie(
        cookie_name(BROWSER, web.csrf.secure),
        f"{made}.{_seal(web, made, name, stored)}",
        max_age=BROWSER_S,
        path=BROWSER_PATH,
        secure=web.csrf.secure,
        httponly=True,
        samesite="strict",
    )


def _seal(web: Web, made: str, name: str, stored: str) -> str:
    return keyed(web, "known browser", made, name, stored)
