"""Who of the researchers is asking: their cookie, what their role allows, forms of their own, and tries to sign in."""

import asyncio
import hashlib
import secrets
import time
from collections import OrderedDict
from collections.abc import Callable, Coroutine
from dataclasses import dataclass, field
from datetime import UTC, datetime
from typing import Annotated, Any
from urllib.parse import quote

from fastapi import Depends, HTTPException, Request, Response
from starlette.requests import HTTPConnection

from server.store import admins
from server.store.admins import AdminSession
from server.store.database import Database
from server.web.auth import cookie_name
from server.web.deps import Web, WebDep
from server.web.forms import Form, read_form
from server.web.passwords import is_right

COOKIE = "researcher"
PATH = "/admin"
TRIES = 5  # of a name from an address, or three times as many of an address or a name alone
WINDOW_S = 15 * 60.0
NOBODY = "a researcher who is not signed in"
_MOST_REMEMBERED = 10_000
_checking = asyncio.Semaphore(2)  # each check takes 64 MiB


def token_hash(token: str) -> str:
    """What is stored of a session's token."""
    return hashlib.sha256(token.encode()).hexdigest()


def _token(connection: HTTPConnection) -> str:
    secure: bool = connection.app.state.web.guard.secure
    return connection.cookies.get(cookie_name(COOKIE, secure), "")[:100]


async def session_of(connection: HTTPConnection) -> AdminSession | None:
    """Who is signed in; None for everybody else. Raises DatabaseDown."""
    token = _token(connection)
    if not token:
        return None
    database: Database = connection.app.state.web.database
    found = await database.read(admins.session, token_hash(token), datetime.now(UTC))
    if found is None:
        return None
    session, touch_is_due = found
    if touch_is_due:
        await database.write(admins.touch, session.token_hash, datetime.now(UTC))
    return session


def _needs(role: str) -> Callable[[Request], Coroutine[Any, Any, AdminSession]]:
    async def signed_in(request: Request) -> AdminSession:
        session = await session_of(request)
        if session is None:
            if request.method == "GET" and "text/html" in request.headers.get("accept", ""):
                raise HTTPException(303, "sign in first", {"Location": f"{PATH}/login?next={quote(request.url.path)}"})
            raise HTTPException(401, "sign in first")
        if not session.may(role):
            raise HTTPException(403, f"this needs the role {role}")
        return session

    return signed_in


WatchDep = Annotated[AdminSession, Depends(_needs("watch"))]
ActDep = Annotated[AdminSession, Depends(_needs("act"))]
OwnDep = Annotated[AdminSession, Depends(_needs("own"))]


async def own_form(request: Request, web: WebDep) -> Form:
    """A form from one of our own pages, made for this session."""
    return await read_form(request, web.guard, form_session(request))


AdminFormDep = Annotated[Form, Depends(own_form)]


def form_session(request: Request) -> str:
    """What a researcher's form is bound to."""
    token = _token(request)
    return token_hash(token) if token else NOBODY


# Signing in and out


@dataclass
class Tries:
    """Failed tries to sign in, in memory: who fails too often waits."""

    failed: "OrderedDict[str, list[float]]" = field(default_factory=OrderedDict)

    def left(self, name: str, address: str) -> int:
        """How many more tries this name has from this address; 0: none for now."""
        now = time.monotonic()
        limits = ((f"{address}\n{name}", TRIES), (f"{address}\n", 3 * TRIES), (f"\n{name}", 3 * TRIES))
        return max(0, min(limit - self._recent(key, now) for key, limit in limits))

    def fail(self, name: str, address: str) -> None:
        now = time.monotonic()
        for key in (f"{address}\n{name}", f"{address}\n", f"\n{name}"):
            self.failed.setdefault(key, []).append(now)
            self.failed.move_to_end(key)
        while len(self.failed) > _MOST_REMEMBERED:
            self.failed.popitem(last=False)

    def _recent(self, key: str, now: float) -> int:
        times = [at for at in self.failed.get(key, ()) if now - at < WINDOW_S]
        if key in self.failed:
            self.failed[key] = times
        return len(times)


async def sign_in(web: Web, name: str, password: str) -> str | None:
    """A new session's token; None for a wrong name or password."""
    stored = await web.database.read(admins.password_hash_of, name)
    async with _checking:
        right = await asyncio.to_thread(is_right, password, stored)
    if not right:
        return None
    token = secrets.token_urlsafe(32)
    await web.database.write(admins.open_session, name, token_hash(token), datetime.now(UTC))
    return token


def set_cookie(response: Response, token: str, *, secure: bool) -> None:
    """Until the browser is closed, for our own pages below /admin only; no script sees it."""
    name = cookie_name(COOKIE, secure)
    response.set_cookie(name, token, path=PATH, secure=secure, httponly=True, samesite="strict")


def forget_cookie(response: Response, *, secure: bool) -> None:
    name = cookie_name(COOKIE, secure)
    response.delete_cookie(name, path=PATH, secure=secure, httponly=True, samesite="strict")
