"""The running games as researchers see them: a card for each, boards for those in view, twice a second by websocket.

What is sent is all that the page shows: a blinded page gets neither conditions nor marks. Changes nothing.
"""

import asyncio
import json
import time
from collections import deque
from contextlib import suppress
from dataclasses import dataclass
from typing import Any, Final

from fastapi import APIRouter, WebSocket, WebSocketDisconnect

from server.play.game import Game
from server.play.games import Games
from server.store import overview
from server.store.admins import AdminSession
from server.store.database import DatabaseDown
from server.store.overview import Played
from server.web.admin_auth import session_of
from server.web.admin_page import arm_names, study_at
from server.web.attention import Attention, Flag
from server.web.deps import Web
from server.web.elsewhere import Alone, Elsewhere, View
from server.web.socket import Sockets
from server.web.tasks import ended

CARDS_EVERY_S: Final = 0.5
FIGURES_EVERY_S: Final = 2.0
SESSION_EVERY_S: Final = 5.0
MOST_BOARDS: Final = 60  # a page can show at once
_SAMPLES: Final = 4000


@dataclass(frozen=True)
class Card:
    """One running game and whose it is."""

    game: Game
    played: Played
    flag: Flag
    rtt_ms: float | None


class Live:
    """Looks at the running games on behalf of everybody who watches; made once in server.main."""

    def __init__(self, web: Web, games: Games, sockets: Sockets, elsewhere: Elsewhere | None = None) -> None:
        self.web, self.games, self.sockets = web, games, sockets
        self.elsewhere = elsewhere or Alone()
        self.models_ms: deque[float] = deque(maxlen=_SAMPLES)  # sampled while somebody watches
        self._attention = Attention()
        self._played: dict[str, Played] = {}
        self._cards: tuple[float, list[Card]] = (-1e9, [])
        self._views: tuple[float, list[View]] = (-1e9, [])
        self._looking = asyncio.Lock()

    async def cards(self, study_ids: tuple[int, ...]) -> list[Card]:
        """The running games of a study; looked at afresh at most twice a second, however many watch."""
        async with self._looking:
            if time.monotonic() - self._cards[0] >= 0.8 * CARDS_EVERY_S:
                await self._look()
        return [card for card in self._cards[1] if card.played.study_id in study_ids]

    async def views(self, study_ids: tuple[int, ...]) -> list[View]:
        """The games of a study that other processes play; asked for at most twice a second."""
        async with self._looking:
            if time.monotonic() - self._views[0] >= 0.8 * CARDS_EVERY_S:
                self._views = (time.monotonic(), await self.elsewhere.views())
        return [view for view in self._views[1] if view.study_id in study_ids]

    async def elsewhere_plays(self, played: Played) -> bool:
        """Whether another process plays the episode."""
        return any(view.id == played.id for view in await self.views((played.study_id,)))

    async def own_views(self) -> list[View]:
        """The games of this process, for the dashboards of others."""
        made = []
        for card in await self.cards(self.web.studies.every_version()):
            made.append(
                View(
                    id=card.played.id,
                    study_id=card.played.study_id,
                    condition=card.played.condition,
                    phase=card.game.session.phase,
                    card=card_of(self, card, {}),
                    board=board_of(card.game, blind=False),
                    still=still_of(card),
                )
            )
            await asyncio.sleep(0)  # the games' own ticks come first
        return made

    async def _look(self) -> None:
        running = [game for game in self.games if game.session.phase != "ended"]
        known = {game.episode for game in running}
        unknown = [episode for episode in known if episode not in self._played]
        if unknown:
            self._played |= await self.web.database.read(overview.played, *unknown)
        self._played = {episode: played for episode, played in self._played.items() if episode in known}
        self._attention.forget(known)
        rtts, now = self.sockets.rtts_ms(), self.games.clock.now()
        cards = []
        for game in running:
            played = self._played.get(game.episode)
            if played is not None:
                rtt_ms = rtts.get(played.participant_id)
                cards.append(Card(game, played, self._attention.flag(game, played.seat, rtt_ms, now), rtt_ms))
            record = game.session.record
            if record is not None and game.session.phase == "running":
                self.models_ms.append(record.models_ms)
        self._cards = (time.monotonic(), cards)

    def since_s(self, flag: Flag) -> int | None:
        """For how many seconds the flag has been up."""
        return None if flag.since is None else max(0, round(self.games.clock.now() - flag.since))


def who(played: Played) -> str:
    """What a participant is called: P-012 of people, B-012 of bots."""
    return f"{'B' if played.simulated else 'P'}-{played.number:03d}"


def card_of(live: Live, card: Card, arms: dict[str, str]) -> dict[str, Any]:
    """What the page is told of a game without its board. `arms`: what each condition is called; empty in blind mode."""
    session, played = card.game.session, card.played
    return {
        "id": played.id,
        "who": who(played),
        "person": played.participant_id,
        "episode": f"E{played.episode}" if played.kind == "episode" else "Tutorial",
        "agent": played.agent,
        "title": session.spec.title,
        "arm": arms.get(played.condition, ""),
        "t": session.trace.timestep,
        "horizon": session.spec.horizon,
        "score": session.trace.score,
        "level": card.flag.level,
        "flag": card.flag.word,
        "since_s": live.since_s(card.flag),
        "rtt_ms": None if card.rtt_ms is None else round(card.rtt_ms),
    }


def kitchen_of(game: Game) -> dict[str, Any]:
    """The current state as the browser draws it."""
    kitchen = game.session.trace.kitchen()
    return {name: getattr(kitchen, name) for name in ("t", "players", "counters", "pots", "score", "soups")}


def board_of(game: Game, blind: bool) -> dict[str, Any]:
    """The current state with the marks that the participant sees."""
    session = game.session
    return {
        "state": kitchen_of(game),
        "prediction": [] if blind else session.displayed,
        "actions": session.trace.last_actions or (4, 4),
    }


def still_of(card: Card) -> dict[str, Any]:
    """What of a board never changes."""
    session = card.game.session
    return {
        "grid": session.trace.layout.grid,
        "seat": card.played.seat,
        "watched_seat": session.spec.watched_seat,
        "tick_ms": session.spec.tick_ms,
        "horizon": session.spec.horizon,
    }


class Watching:
    """One open dashboard: what it shows and what it has been told."""

    def __init__(self, live: Live, study: str, admin: AdminSession) -> None:
        self.live, self.admin = live, admin
        self.study_ids, self.study = study_at(live.web, study)
        self.arms = {} if admin.blind else arm_names(self.study, blind=False)
        self.shown: list[str] = []
        self.tab = "active"
        self._told: set[str] = set()

    def asked(self, text: str) -> None:
        """What the page shows now: {"show": [episodes], "tab": name}. Raises ValueError for anything else."""
        try:
            wish = json.loads(text)
        except RecursionError:  # brackets in brackets
            raise ValueError("a wish is an object") from None
        if not isinstance(wish, dict):
            raise ValueError("a wish is an object")
        shown = wish.get("show", self.shown)
        if not isinstance(shown, list) or not all(isinstance(one, str) for one in shown):
            raise ValueError("show is a list of episodes")
        self.shown = shown[:MOST_BOARDS]
        tab = wish.get("tab")
        if isinstance(tab, str) and tab in overview.TABS:
            self.tab = tab

    async def news(self) -> dict[str, Any]:
        """Cards of all games and boards of those in view."""
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

    def _board(self, one: Card | View) -> dict[str, Any]:
        if isinstance(one, Card):
            return board_of(one.game, self.admin.blind)
        return one.board | ({"prediction": []} if self.admin.blind else {})


async def let_in(socket: WebSocket, live: Live) -> AdminSession | None:
    """Accepts the socket of a researcher who is signed in, from one of our own pages; refuses all others."""
    try:
        admin = await session_of(socket) if live.web.guard.is_own_origin(socket) else None
    except DatabaseDown:
        await socket.close(1013)
        return None
    if admin is None:
        await socket.close(1008)
        return None
    await socket.accept()
    return admin


async def still_in(socket: WebSocket, admin: AdminSession) -> bool:
    """Whether the session goes on as it was: neither ended nor with conditions shown or hidden since."""
    with suppress(DatabaseDown):
        return await session_of(socket) == admin
    return True


router = APIRouter(prefix="/admin")


@router.websocket("/s/{name}/live")
async def watch(socket: WebSocket, name: str) -> None:
    """Cards and boards twice a second, figures every 2 s."""
    live: Live = socket.app.state.live
    admin = await let_in(socket, live)
    if admin is None:
        return
    if not live.web.studies.versions(name):
        await socket.close(1008)
        return
    watching = Watching(live, name, admin)
    teller = asyncio.create_task(_tell(socket, watching))
    try:
        while not teller.done():
            watching.asked(await socket.receive_text())
    except (WebSocketDisconnect, ValueError, KeyError, RuntimeError):
        pass  # gone, or no page of ours
    finally:
        await ended(teller)
        with suppress(RuntimeError, WebSocketDisconnect):
            await socket.close()


async def _tell(socket: WebSocket, watching: Watching) -> None:
    figures = socket.app.state.figures
    checked = told = time.monotonic() - FIGURES_EVERY_S
    tab = ""
    while True:
        now = time.monotonic()
        if now - checked >= SESSION_EVERY_S:
            checked = now
            if not await still_in(socket, watching.admin):
                return await socket.close(4003, "sign in again")
        with suppress(DatabaseDown):
            await socket.send_text(json.dumps(await watching.news(), separators=(",", ":")))
            if now - told >= FIGURES_EVERY_S or tab != watching.tab:
                told, tab = now, watching.tab
                news = await figures.of(watching.study_ids, watching.study, watching.tab, watching.admin.blind)
                news = {"type": "figures", **news, "alerts": socket.app.state.alerts.shown(watching.study.name)}
                await socket.send_text(json.dumps(news, separators=(",", ":")))
        await asyncio.sleep(CARDS_EVERY_S)
