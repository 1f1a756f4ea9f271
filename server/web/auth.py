"""Authentication of participants by a cookie, and of simulated ones by a mark."""

import hashlib
import hmac

from fastapi import Request, Response
from itsdangerous import Signer
from starlette.requests import HTTPConnection

from server.web.csrf import NOBODY
from server.web.services import services_of

COOKIE = "participant"
COOKIE_S = 30 * 24 * 3600
BOT_MARK = "simulated_by"  # the field of a consent form with `bot_mark`


def cookie_name(name: str, secure: bool) -> str:
    """Return the cookie's name; over TLS with a prefix, so that browsers accept it only over TLS and no other subdomain
    can set it."""
    return f"__Secure-{name}" if secure else name


def token_of(connection: HTTPConnection) -> str | None:
    """Return the participant's token, from the cookie."""
    secure = services_of(connection).web.csrf.secure
    token = connection.cookies.get(cookie_name(COOKIE, secure), "")
    return token if 20 <= len(token) <= 200 else None


def set_cookie(response: Response, study: str, token: str, *, secure: bool) -> None:
    """Set the cookie, for this study's pages only and invisible to scripts."""
    name, path = cookie_name(COOKIE, secure), f"/s/{study}"
    response.set_cookie(name, token, max_age=COOKIE_S, path=path, secure=secure, httponly=True, samesite="lax")


def forget_cookie(response: Response, study: str, *, secure: bool) -> None:
    name = cookie_name(COOKIE, secure)
    response.delete_cookie(name, path=f"/s/{study}", secure=secure, httponly=True, samesite="lax")


def bot_mark(secret: bytes, visit: str) -> str:
    """Return what a simulated participant sends at consent: making it needs the server's secret, so that nobody else is
    counted as a bot."""
    return _bot_signer(secret).get_signature(visit).decode()


def is_bot_mark(secret: bytes, visit: str, mark: str) -> bool:
    """Return whether the mark was made with the server's secret for this consent page."""
    return _bot_signer(secret).verify_signature(visit, mark)


def _bot_signer(secret: bytes) -> Signer:
    return Signer(secret, salt="simulated", key_derivation="hmac", digest_method=hashlib.sha256)


def session_of(request: Request) -> str:
    """Return what a form is bound to: the participant's token, or nothing before consent."""
    return token_of(request) or NOBODY


def token_for(secret: bytes, study: str, visit: str) -> str:
    """Return the participant's token. It is derived from the consent page, so submitting the page twice does not create
    two participants."""
    return hmac.new(secret, f"participant\n{study}\n{visit}".encode(), hashlib.sha256).hexdigest()
