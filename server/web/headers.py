"""Security headers on every answer: nothing from elsewhere, no code inside a page, no frame around it."""

from starlette.datastructures import Headers, MutableHeaders
from starlette.types import ASGIApp, Message, Receive, Scope, Send

_POLICY = (
    "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self' data: blob:; font-src 'self'; "
    "media-src 'self'; connect-src 'self'{sockets}; worker-src 'self'; manifest-src 'self'; form-action 'self'{forms}; "
    "base-uri 'none'; frame-ancestors {framed_by}"
)
_FIXED = {
    "X-Content-Type-Options": "nosniff",
    "X-Frame-Options": "DENY",
    "Referrer-Policy": "same-origin",
    "Cross-Origin-Opener-Policy": "same-origin",
    "Cross-Origin-Resource-Policy": "same-origin",
    "Permissions-Policy": "camera=(), microphone=(), geolocation=(), payment=(), usb=()",
}
_YEAR_S = 365 * 24 * 3600


class SecurityHeaders:
    """Middleware. `secure`: the public address is https, so browsers shall never ask without TLS again."""

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
            await send(message)

        await self._app(scope, receive, send_with_headers)


def security_headers(host: str, secure: bool) -> dict[str, str]:
    """The headers of an answer to a browser that asked for `host`."""
    headers = _FIXED | policy(host, secure)
    return headers | ({"Strict-Transport-Security": f"max-age={_YEAR_S}"} if secure else {})


def policy(host: str, secure: bool, form_to: str = "", framed_by: str = "'none'") -> dict[str, str]:
    """The page's own policy. A recruiter may get its form (`form_to`) or show the page in a frame (`framed_by`, which
    browsers heed rather than X-Frame-Options)."""
    # Some browsers do not count a websocket of our own address as 'self'.
    plain = all(letter.isalnum() or letter in ".-:[]" for letter in host)
    sockets = f" {'wss' if secure else 'ws'}://{host}" if host and plain else ""
    forms = f" {form_to}" if form_to else ""
    return {"Content-Security-Policy": _POLICY.format(sockets=sockets, forms=forms, framed_by=framed_by)}
