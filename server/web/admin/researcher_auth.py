"""Sign-in of researchers: their session cookie, what their role allows, signed forms, and limited tries."""

import hashlib
import secrets
from collections.abc import Callable, Coroutine
from contextlib import suppress
from datetime import UTC, datetime
from typing import Annotated, Any, Final
from urllib.parse import quote

from fastapi import Depends, HTTPException, Request, Response
from sqlalchemy import Connection
from starlette.requests import HTTPConnection

from server.store import admins, audit
from server.store.admins import AdminSession
from server.store.database import DatabaseDown
from server.web import guess_limits
from server.web.auth import cookie_name
from server.web.dependencies import Web, WebDep
from server.web.forms import Form, read_form
from server.web.guess_limits import GuessOutcome, Hashing
from server.web.services import services_of

COOKIE = "researcher"
PATH = "/admin"
NOBODY = "a researcher who is not signed in"


def token_hash(token: str) -> str:
    """Return what is stored of a session's token."""
    return hashlib.sha256(token.encode()).hexdigest()


def _token(connection: HTTPConnection) -> str:
    secure = services_of(connection).web.csrf.secure
    return connection.cookies.get(cookie_name(COOKIE, secure), "")[:100]


async def session_of(connection: HTTPConnection) -> AdminSession | None:
    """Return the signed-in researcher, or None. Raises DatabaseDown."""
    token = _token(connection)
    if not token:
        return None
    database = services_of(connection).web.database
    found = await database.read(admins.session, token_hash(token), datetime.now(UTC))
    if found is None:
        return None
    session, touch_is_due = found
    if touch_is_due:
        with suppress(DatabaseDown):  # a full disk can still be read: that is when a researcher has to look
            await database.write(admins.touch, session.token_hash, datetime.now(UTC))
    return session


_SIGN_IN: Final = "You are not signed in. Sign in at /admin/login."
_ASK: Final = "The person who runs the server can give it to you: `kitchenmind admin role NAME ROLE`."


def _needs(role: str) -> Callable[[Request], Coroutine[Any, Any, AdminSession]]:
    async def signed_in(request: Request) -> AdminSession:
        session = await session_of(request)
        if session is None:
            if request.method == "GET" and "text/html" in request.headers.get("accept", ""):
                raise HTTPException(303, _SIGN_IN, {"Location": f"{PATH}/login?next={quote(request.url.path)}"})
            raise HTTPException(401, _SIGN_IN)
        if not session.may(role):
            raise HTTPException(403, f"This needs the role {role}. {_ASK}")
        return session

    return signed_in


WatchDep = Annotated[AdminSession, Depends(_needs("watch"))]
ActDep = Annotated[AdminSession, Depends(_needs("act"))]
OwnDep = Annotated[AdminSession, Depends(_needs("own"))]


async def own_form(request: Request, web: WebDep) -> Form:
    """Return a form from one of our own pages, made for this session."""
    return await read_form(request, web.csrf, form_session(request))


AdminFormDep = Annotated[Form, Depends(own_form)]


def form_session(request: Request) -> str:
    """Return what a researcher's form is bound to."""
    token = _token(request)
    return token_hash(token) if token else NOBODY


# Signing in and out


async def sign_in(
    web: Web, hashing: Hashing, connection: HTTPConnection, name: str, password: str
) -> tuple[GuessOutcome, str | None]:
    """Check name and password. Returns the outcome, and the stored hash of an account. Raises guessing.Busy."""
    stored = await web.database.read(admins.password_hash_of, name)
    origin = guess_limits.known_browser(web, connection, name, stored)
    if origin is None:
        origin = guess_limits.origin_of_address(web, connection, guess_limits.PASSWORD)
    counted = (
        name if stored is not None else guess_limits.keyed(web, "name", name)
    )  # it may be a password, typed too early
    with hashing.place(origin):
        return await guess_limits.guarded(web, origin, counted, lambda: hashing.is_right(password, stored)), stored


async def begin_session(web: Web, name: str, before: AdminSession | None) -> str:
    """Return the token of a new session, which replaces `before`. One transaction, with its line in the audit log."""
    token = secrets.token_urlsafe(32)

    def begin(connection: Connection) -> None:
        if before is not None:
            admins.close_session(connection, before.token_hash)
        admins.open_session(connection, name, token_hash(token), datetime.now(UTC))
        audit.add(connection, name, "sign in")

    await web.database.write(begin)
    return token


def set_cookie(response: Response, token: str, *, secure: bool) -> None:
    """Set the session cookie: until the browser is closed, for our own pages below /admin only, and invisible to
    scripts."""
    name = cookie_name(COOKIE, secure)
    response.set_cookie(name, token, path=PATH, secure=secure, httponly=True, samesite="strict")


def forget_cookie(response: Response, *, secure: bool) -> None:
    name = cookie_name(COOKIE, secure)
    response.delete_cookie(name, path=PATH, secure=secure, httponly=True, samesite="strict")
