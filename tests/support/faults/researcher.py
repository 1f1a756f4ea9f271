"""A researcher as fault scenarios need one: signs in, keeps dashboards open, asks for an export."""

import asyncio
import json
import os
import re
import subprocess
import sys
from contextlib import AsyncExitStack
from typing import Any

import httpx
from websockets.asyncio.client import connect

from tests.support.real_server import ROOT, RealServer


def account_for(server: RealServer) -> None:
    """`ada` may sign in; the password is made and kept for `FaultResearcher`."""
    line = [sys.executable, str(ROOT / "kitchenmind"), "admin", "create", "ada", "--role", "own"]
    environment = {**os.environ, "KITCHENMIND_DATABASE": server.database}
    made = subprocess.run(line, env=environment, stdin=subprocess.DEVNULL, capture_output=True, text=True, check=False)
    assert made.returncode == 0, made.stderr
    FaultResearcher.password = re.search(r"password: (\S+)", made.stdout).group(1)  # type: ignore[union-attr]


class FaultResearcher:
    """`async with FaultResearcher(url) as ada:` signed in until the end of the block."""

    password = ""

    def __init__(self, url: str) -> None:
        self._url, self._stack = url, AsyncExitStack()
        self._client = httpx.AsyncClient(base_url=url, headers={"origin": url}, follow_redirects=True, timeout=120)

    async def __aenter__(self) -> "FaultResearcher":
        await self._post("/admin/login", "/admin/login", name="ada", password=self.password)
        await self._post("/admin", "/admin/blind", blind="off")
        return self

    async def __aexit__(self, *_: object) -> None:
        await self._stack.aclose()
        await self._client.aclose()

    async def _post(self, page: str, path: str, **fields: str) -> httpx.Response:
        shown = await self._client.get(page)
        token = re.search(r'name="form_token" value="([^"]*)"', shown.text)
        assert token, shown.text[:300]
        answer = await self._client.post(path, data={"form_token": token.group(1), **fields})
        assert answer.status_code < 400, answer.text[:300]
        return answer

    async def watch(self, study: str, screens: int) -> None:
        """So many dashboards, all boards in view."""
        cookie = "; ".join(f"{name}={value}" for name, value in self._client.cookies.items())
        url = f"ws{self._url.removeprefix('http')}/admin/s/{study}/live"
        for _ in range(screens):
            opened: Any = connect(url, additional_headers={"Cookie": cookie}, origin=self._url, max_size=None)  # type: ignore[arg-type]
            socket = await self._stack.enter_async_context(opened)
            self._stack.push_async_callback(_cancelled, asyncio.create_task(_look(socket)))

    async def export(self, study: str) -> int:
        """Bytes of the archive."""
        return len((await self._post(f"/admin/s/{study}", f"/admin/s/{study}/export")).content)


async def _look(socket: Any) -> None:
    async for frame in socket:
        news = json.loads(frame)
        if news["type"] == "cards" and not news["boards"] and news["cards"]:
            await socket.send(json.dumps({"show": [card["id"] for card in news["cards"]]}))


async def _cancelled(task: "asyncio.Task[None]") -> None:
    task.cancel()
    await asyncio.gather(task, return_exceptions=True)
