"""Sockets for researchers: none stays open without news."""

import asyncio
import json
import re
from types import SimpleNamespace
from typing import Any, cast
from unittest.mock import AsyncMock

import pytest
from starlette.websockets import WebSocketDisconnect

from server.play.close_codes import CloseCode
from server.settings import ROOT
from server.store.database import DatabaseDown
from server.web.admin import live_boards, replay_page
from server.web.admin.live_boards import converse


class SilentSocket:
    """A socket whose page says nothing, until it goes."""

    def __init__(self) -> None:
        self.codes: list[int] = []
        self.gone = asyncio.Event()

    async def receive_text(self) -> str:
        await self.gone.wait()
        raise WebSocketDisconnect

    async def close(self, code: int = CloseCode.FINISHED, reason: str = "") -> None:
        self.codes.append(code)


def ignore(_: str) -> None: ...


async def test_a_fault_in_the_news_closes_the_socket_and_is_logged(caplog: pytest.LogCaptureFixture) -> None:
    async def tell() -> None:
        raise KeyError("a figure")

    page = SilentSocket()
    async with asyncio.timeout(20):
        await converse(page, tell(), ignore)  # type: ignore[arg-type]
    assert page.codes[0] == CloseCode.FAILED
    assert "a figure" in caplog.text


async def test_a_page_that_goes_ends_the_news() -> None:
    page, began, over = SilentSocket(), asyncio.Event(), asyncio.Event()

    async def tell() -> None:
        began.set()
        try:
            await asyncio.Event().wait()
        finally:
            over.set()

    talk = asyncio.create_task(converse(page, tell(), ignore))  # type: ignore[arg-type]
    async with asyncio.timeout(20):
        await began.wait()
        page.gone.set()
        await talk
    assert over.is_set()


@pytest.mark.parametrize("failing", ["figures", "cards"])
async def test_alerts_are_sent_while_the_database_cannot_be_read(failing: str) -> None:
    sent: list[dict[str, Any]] = []
    down, alerts = DatabaseDown("away"), [{"text": "The database cannot be reached.", "path": "", "since_s": 5}]

    async def send_text(text: str) -> None:
        sent.append(json.loads(text))

    loop = SimpleNamespace(between_batches=AsyncMock())
    services = SimpleNamespace(
        live=SimpleNamespace(games=SimpleNamespace(loop=loop)),
        dashboard=SimpleNamespace(of=AsyncMock(side_effect=down)),
        alerts=SimpleNamespace(shown=lambda _: alerts),
    )
    watching = SimpleNamespace(
        admin=SimpleNamespace(blind=True),
        study=SimpleNamespace(name="small"),
        study_ids=(1,),
        tab="active",
        follow=lambda: None,
        news=AsyncMock(side_effect=down) if failing == "cards" else AsyncMock(return_value={"type": "cards"}),
    )
    telling = asyncio.create_task(
        live_boards._tell(cast(Any, SimpleNamespace(send_text=send_text)), cast(Any, services), cast(Any, watching))
    )
    async with asyncio.timeout(20):
        while {"type": "alerts", "alerts": alerts} not in sent:
            await asyncio.sleep(0.01)
    telling.cancel()


async def test_a_game_that_moves_to_another_process_is_not_over(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(replay_page, "STATUS_EVERY_S", 0.01)
    sent: list[dict[str, Any]] = []
    reads = iter([DatabaseDown("away"), False, True])

    async def send_text(text: str) -> None:
        sent.append(json.loads(text))

    async def read(_: object, episode: str) -> dict[str, Any]:
        found = next(reads)
        if isinstance(found, DatabaseDown):
            raise found
        return {episode: SimpleNamespace(is_over=found)}

    nobody = AsyncMock(return_value=[])
    live = SimpleNamespace(web=SimpleNamespace(database=SimpleNamespace(read=read)), cards=nobody, views=nobody)
    socket = SimpleNamespace(send_text=send_text, close=AsyncMock())
    async with asyncio.timeout(20):
        await replay_page._tell(
            cast(Any, socket), cast(Any, live), ((1,), "e1"), cast(Any, SimpleNamespace(blind=True))
        )
    assert [one["type"] for one in sent] == ["status", "status", "over"]
    assert next(reads, None) is None, "not before its end was stored"


def test_what_is_read_of_the_application_s_state_is_set_there() -> None:
    text = "\n".join(path.read_text("utf-8") for path in (ROOT / "server").rglob("*.py"))
    names = set(re.findall(r"app\.state\.(\w+)", text))
    made = {name for line in text.splitlines() for name in re.findall(r"app\.state\.(\w+)(?=[^=(]* = )", line)}
    assert "services" in names
    assert names <= made
