"""The outermost middleware for HTTP: HEAD works wherever GET does, and redirects stay on this server."""

from starlette.datastructures import MutableHeaders
from starlette.types import ASGIApp, Message, Receive, Scope, Send


class Boundary:
    """Middleware."""

    def __init__(self, app: ASGIApp) -> None:
        self._app = app

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        if scope["type"] != "http":
            await self._app(scope, receive, send)
            return
        head = scope["method"] == "HEAD"

        async def send_bounded(message: Message) -> None:
            if message["type"] == "http.response.start":
                _keep_here(MutableHeaders(scope=message))
            elif head and message["type"] == "http.response.body":
                message = {**message, "body": b""}
            await send(message)

        await self._app({**scope, "method": "GET"} if head else scope, receive, send_bounded)


def _keep_here(headers: MutableHeaders) -> None:
    """Make an absolute redirect relative: the framework writes it with the Host that the client sent.

    Every redirect of ours leads to one of our own pages, so only the path is needed.
    """
    scheme, separator, rest = headers.get("location", "").partition("://")
    if separator and scheme in ("http", "https"):
        headers["location"] = "/" + rest.partition("/")[2].lstrip("/")
