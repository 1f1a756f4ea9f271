"""Serve behind a path of the public address, such as https://lab.example.org/kitchen: the routes are independent of it.
Pages take the path from `CsrfProtection.root`; this middleware takes it off requests, if the proxy has left it there,
and puts it into redirects and cookies.
"""

import re
from typing import Final

from starlette.datastructures import MutableHeaders
from starlette.types import ASGIApp, Message, Receive, Scope, Send

_COOKIE_PATH: Final = re.compile(r"(;\s*path=)/", re.IGNORECASE)
_STARTS: Final = ("http.response.start", "websocket.accept")


class PublicPath:
    """Middleware. `root`: the path, like `/kitchen`; empty: there is none."""

    def __init__(self, app: ASGIApp, root: str = "") -> None:
        self._app, self._root = app, root

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        if not self._root or scope["type"] not in ("http", "websocket"):
            await self._app(scope, receive, send)
            return

        async def send_outside(message: Message) -> None:
            if message["type"] in _STARTS:
                self._put_outside(MutableHeaders(scope=message))
            await send(message)

        await self._app(self._inside(scope), receive, send_outside)

    def _inside(self, scope: Scope) -> Scope:
        path: str = scope["path"]
        if path != self._root and not path.startswith(self._root + "/"):
            return scope
        raw = scope.get("raw_path") or path.encode()
        begin = len(self._root)  # letters, digits, - and _: as long in bytes
        return {**scope, "path": path[begin:] or "/", "raw_path": raw[begin:] or b"/"}

    def _put_outside(self, headers: MutableHeaders) -> None:
        headers.raw[:] = [(name, self._outside(name, value)) for name, value in headers.raw]

    def _outside(self, name: bytes, value: bytes) -> bytes:
        text = value.decode("latin-1")
        if name.lower() == b"location" and text.startswith("/"):
            text = self._root + text
        elif name.lower() == b"set-cookie":
            text = _COOKIE_PATH.sub(lambda found: f"{found[1]}{self._root}/", text, count=1)
        return text.encode("latin-1")
