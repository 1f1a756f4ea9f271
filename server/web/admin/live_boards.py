"""Send researchers the running games twice a second by websocket: cards of all, boards of those in view.

A blinded page gets neither conditions nor marks.
"""

import asyncio
import json
import logging
import time
from collections.abc import Callable, Coroutine
from contextlib import suppress
from typing import Any, Final

import msgspec
from fastapi import APIRouter, WebSocket, WebSocketDisconnect

from server.background_tasks import ended
from server.monitoring.arm_names import arm_names
from server.monitoring.live_games import CARDS_EVERY_S, Card, LiveGames, blinded, card_of, still_of
from server.monitoring.peers import View
from server.play.close_codes import CloseCode
from server.store import overview
from server.store.admins import AdminSession
from server.store.database import DatabaseDown
from server.web.admin.rendering import study_at
from server.web.admin.researcher_auth import session_of
from server.web.dependencies import Web
from server.web.services import Services, ServicesDep, services_of

FIGURES_EVERY_S: Final = 2.0
SESSION_EVERY_S: Final = 5.0
log = logging.getLogger(__name__)
MAX_BOARDS: Final = 60  # a page can show at once


class Watching:
    """One open dashboard: what it shows and what it has been sent."""

    def __init__(self, web: Web, live: LiveGames, study: str, admin: AdminSession) -> None:
        self.web, self.live, self.admin = web, live, admin
        self.study_ids, self.study = study_at(web, study)
        self.arms = self._arms()
        self.shown: list[str] = []
        self.tab = "active"
        self._told: set[str] = set()

    def follow(self) -> None:
        """Also show the participants of a version that was opened after the page."""
        study_ids, study = study_at(self.web, self.study.name)
        if study_ids != self.study_ids or study is not self.study:
            self.study_ids, self.study = study_ids, study
            self.arms = self._arms()

    def _arms(self) -> dict[str, str]:
        if self.admin.blind:
            return {}
        versions = filter(None, map(self.web.studies.version, self.study_ids))
        return arm_names(self.study, False, {one.name for version in versions for one in version.conditions})

    def asked(self, text: str) -> None:
        """Set what the page shows now: {"show": [episodes], "tab": name}. Raises ValueError for anything else."""
        try:
            choice = json.loads(text)
        except RecursionError:  # brackets in brackets
            raise ValueError("a choice of boards is an object") from None
        if not isinstance(choice, dict):
            raise ValueError("a choice of boards is an object")
        shown = choice.get("show", self.shown)
        if not isinstance(shown, list) or not all(isinstance(one, str) for one in shown):
            raise ValueError("show is a list of episodes")
        self.shown = shown[:MAX_BOARDS]
        tab = choice.get("tab")
        if isinstance(tab, str) and tab in overview.TABS:
            self.tab = tab

    async def news(self) -> dict[str, Any]:
        """Return the cards of all games and the boards of those in view."""
        cards, views = await self.live.cards(self.study_ids), await self.live.views(self.study_ids)
        by_id: dict[str, Card | View] = {view.id: view for view in views}
        by_id |= {card.played.id: card for card in cards}
        shown = {episode: by_id[episode] for episode in self.shown if episode in by_id}
        fresh = {episode: one for episode, one in shown.items() if episode not in self._told}
        self._told |= fresh.keys()
        return {
            "type": "cards",
            "cards": [self._card(one) for one in by_id.values()],
            "boards": {episode: self._board(one) for episode, one in shown.items()},
            "still": {episode: still_of(one) if isinstance(one, Card) else one.still for episode, one in fresh.items()},
        }

    def _card(self, one: Card | View) -> dict[str, Any]:
        if isinstance(one, Card):
            return card_of(self.live, one, self.arms)
        return one.card | {"arm": self.arms.get(one.condition, "")}

    def _board(self, one: Card | View) -> msgspec.Raw | dict[str, Any]:
        if isinstance(one, Card):
            return self.live.encoded_board(one.game, self.admin.blind)
        return blinded(one.board) if self.admin.blind else one.board


async def let_in(socket: WebSocket) -> AdminSession | None:
    """Accept the socket of a researcher who is signed in, from one of our own pages; refuse all others."""
    try:
        admin = await session_of(socket) if services_of(socket).web.csrf.is_own_origin(socket) else None
    except DatabaseDown:
        await socket.close(CloseCode.TRY_LATER)
        return None
    if admin is None:
        await socket.close(CloseCode.REFUSED)
        return None
    await socket.accept()
    return admin


async def still_in(socket: WebSocket, admin: AdminSession) -> bool:
    """Return whether the session continues as it was: neither ended nor with conditions shown or hidden since."""
    with suppress(DatabaseDown):
        return await session_of(socket) == admin
    return True


router = APIRouter(prefix="/admin")


@router.websocket("/s/{name}/live")
async def watch(socket: WebSocket, name: str, services: ServicesDep) -> None:
    """Send cards and boards twice a second, alerts and figures every 2 s."""
    web = services.web
    admin = await let_in(socket)
    if admin is None:
        return
    if not web.studies.versions(name):
        await socket.close(CloseCode.REFUSED)
        return
    watching = Watching(web, services.live, name, admin)
    await converse(socket, _tell(socket, services, watching), watching.asked)


async def converse(socket: WebSocket, send: Coroutine[Any, Any, None], hear: Callable[[str], None]) -> None:
    """Send news until one side ends it. After an error here the socket closes, because a page that keeps showing old
    news looks calm."""
    sender, reader = asyncio.create_task(send), asyncio.create_task(_listen(socket, hear))
    try:
        await asyncio.wait({sender, reader}, return_when=asyncio.FIRST_COMPLETED)
        error = sender.exception() if sender.done() and not sender.cancelled() else None
        if error is not None:
            if not isinstance(error, WebSocketDisconnect | RuntimeError):  # the page is gone
                log.error("cannot send news to a researcher's page", exc_info=error)
            with suppress(RuntimeError, WebSocketDisconnect):
                await socket.close(CloseCode.FAILED, "the server failed")
    finally:
        await ended(sender, reader)
        with suppress(RuntimeError, WebSocketDisconnect):
            await socket.close()


async def _listen(socket: WebSocket, hear: Callable[[str], None]) -> None:
    """Receive until the page is gone or sends something invalid."""
    with suppress(WebSocketDisconnect, ValueError, KeyError, RuntimeError):
        while True:
            hear(await socket.receive_text())


async def _tell(socket: WebSocket, services: Services, watching: Watching) -> None:
    dashboard = services.dashboard
    checked = sent_at = time.monotonic() - FIGURES_EVERY_S
    tab = ""
    while True:
        now = time.monotonic()
        if now - checked >= SESSION_EVERY_S:
            checked = now
            if not await still_in(socket, watching.admin):
                return await socket.close(CloseCode.SIGNED_OUT, "sign in again")
        with suppress(DatabaseDown):
            await services.live.games.loop.between_batches()
            watching.follow()
            await send_news(socket, await watching.news())
        if now - sent_at >= FIGURES_EVERY_S or tab != watching.tab:
            sent_at, tab = now, watching.tab
            # By themselves: they are read from no database, and one of them says that it cannot be reached.
            await send_news(socket, {"type": "alerts", "alerts": services.alerts.shown(watching.study.name)})
            with suppress(DatabaseDown):
                news = await dashboard.of(watching.study_ids, watching.study, watching.tab, watching.admin.blind)
                await services.live.games.loop.between_batches()
                await send_news(socket, {"type": "figures", **news})
        await asyncio.sleep(CARDS_EVERY_S)


async def send_news(socket: WebSocket, news: dict[str, Any]) -> None:
    """Send it as JSON. msgspec: with many open pages the standard library's encoder took the games' time."""
    await socket.send_text(msgspec.json.encode(news).decode())
