"""Security headers on every response: no external resources, no inline code, no embedding in frames."""

import re
from typing import Final

from starlette.datastructures import Headers, MutableHeaders
from starlette.types import ASGIApp, Message, Receive, Scope, Send

_POLICY = (
    "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self' data: blob:; font-src 'self'; "
    "media-src 'self'; connect-src 'self'{sockets}; worker-src 'self'; manifest-src 'self'; form-action 'self'{forms}; "
    "base-uri 'none'; frame-src {frames}; frame-ancestors {framed_by}"
)
_FIXED = {
    "X-Content-Type-Options": "nosniff",
    "X-Frame-Options": "DENY",
    "Referrer-Policy": "same-origin",
    "Cross-Origin-Opener-Policy": "same-origin",
    "Cross-Origin-Resource-Policy": "same-origin",
    "Permissions-Policy": "camera=(), microphone=(), geolocation=(), payment=(), usb=()",
}
_SAME_FOR_ALL: Final = "/static/"
_YEAR_S = 365 * 24 * 3600
_HOST: Final = r"(?:[A-Za-z0-9_-]+(?:\.[A-Za-z0-9_-]+)*\.?|\[[0-9A-Fa-f:.]+\])(?::[0-9]{1,5})?"
_PLAIN_HOST: Final = re.compile(_HOST)
_ORIGIN: Final = re.compile(rf"https?://(?:\*\.)?{_HOST}")
_NOBODY: Final = "'none'"
OURSELVES: Final = "'self'"


class SecurityHeaders:
    """Middleware. `secure`: the public address is https, so browsers must not use it without TLS again. No response is
    cached, except static files.
    """

    def __init__(self, app: ASGIApp, secure: bool = False) -> None:
        self._app = app
        self._secure = secure

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        if scope["type"] != "http":
            await self._app(scope, receive, send)
            return

        headers_of_request = Headers(scope=scope)

        async def send_with_headers(message: Message) -> None:
            if message["type"] == "http.response.start":
                headers = MutableHeaders(scope=message)
                for name, value in security_headers(headers_of_request.get("host", ""), self._secure).items():
                    headers.setdefault(name, value)
                if not scope["path"].startswith(_SAME_FOR_ALL):
                    headers.setdefault("Cache-Control", "no-store")
            await send(message)

        await self._app(scope, receive, send_with_headers)


def security_headers(host: str, secure: bool) -> dict[str, str]:
    """Return the headers of a response to a request for `host`."""
    headers = _FIXED | policy(host, secure)
    return headers | ({"Strict-Transport-Security": f"max-age={_YEAR_S}"} if secure else {})


def policy(
    host: str, secure: bool, form_to: str = "", framed_by: str = _NOBODY, frames: str = _NOBODY
) -> dict[str, str]:
    """Return the page's own content security policy.

    A recruiter may get its form (`form_to`) or show the page in a frame (`framed_by`, which browsers prefer to
    X-Frame-Options). OURSELVES: a page of ours may show it in a frame, or it may show one of ours (`frames`). Raises
    ValueError for anything that is not a plain origin: a policy is one line of text, so a space or a semicolon in a
    value would rewrite the rest of it.
    """
    # Some browsers do not count a websocket of our own address as 'self'.
    sockets = f" {'wss' if secure else 'ws'}://{host}" if is_plain_host(host) else ""
    forms = f" {_origin(form_to)}" if form_to else ""
    around, inside = (one if one in (_NOBODY, OURSELVES) else _origin(one) for one in (framed_by, frames))
    made = _POLICY.format(sockets=sockets, forms=forms, frames=inside, framed_by=around)
    return {"Content-Security-Policy": made}


def is_plain_host(host: str) -> bool:
    """Return whether it is a host name or address, perhaps with a port, and nothing else."""
    return _PLAIN_HOST.fullmatch(host) is not None


def _origin(value: str) -> str:
    if _ORIGIN.fullmatch(value) is None:
        raise ValueError("a content security policy takes plain origins only, like https://www.example.org")
    return value
