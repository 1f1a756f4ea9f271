"""Routes of one episode for researchers, running or ended. A blinded researcher gets neither marks nor predictions."""

import asyncio
import time
from contextlib import suppress
from typing import Final

from fastapi import APIRouter, HTTPException, Request, Response, WebSocket

from overcooked.layout import LayoutError
from server.monitoring.live_games import Card, LiveGames, card_of, who
from server.monitoring.peers import View
from server.monitoring.replay import StoredTicks, input_of, record_json, row_of, visible
from server.play.close_codes import CloseCode
from server.store import interventions, overview
from server.store.admins import AdminSession
from server.store.database import DatabaseDown
from server.store.episodes import BrokenEpisode
from server.study.locale import locale
from server.web.admin.actions import GameDep
from server.web.admin.live_boards import SESSION_EVERY_S, converse, let_in, send_news, still_in
from server.web.admin.rendering import AdminPage, study_at
from server.web.admin.researcher_auth import WatchDep
from server.web.dependencies import WebDep
from server.web.services import ServicesDep

router = APIRouter(prefix="/admin/s/{name}/game/{episode}")
LOOK_EVERY_S: Final = 0.05
STATUS_EVERY_S: Final = 0.5
STORED_EVERY_S: Final = 0.2
PAUSED_EVERY_S: Final = 2.0
_FLAG: Final = {"flag": "Not played now", "level": 0, "since_s": None, "rtt_ms": None}
NOT_PLAYED: Final = {"type": "status", "phase": "paused", **_FLAG}


@router.get("")
async def page(request: Request, name: str, admin: WatchDep, services: ServicesDep, game: GameDep) -> Response:
    """Show the game as the participant sees it, its time line, and the available actions."""
    web, live = services.web, services.live
    _, study = study_at(web, name)
    held = await web.database.read(interventions.exclusions_of, [game.participant_id])
    titles = {kitchen.name: kitchen.title.of("en") for kitchen in study.layouts}
    mine = await web.database.read(overview.played_by, game.participant_id)
    return AdminPage(request, admin).render(
        "game.html",
        tab="games",
        study=study,
        game=game,
        label=who(game),
        arm="" if admin.blind else game.condition,
        shown="" if admin.blind else "misleading" if game.misleading else game.shown,
        layout=titles.get(game.layout, game.layout),
        others=[one for one in mine if one.started_at is not None],
        is_live=live.games.get(game.id) is not None or await live.peer_plays(game),
        exclusions=[one for one in held if one.episode_id in (None, game.id)],
        reasons=interventions.EXCLUSION_REASONS,
        texts=locale("en").section("game"),
    )


@router.get("/record.json")
async def record(admin: WatchDep, web: WebDep, game: GameDep) -> Response:
    """Return everything that is stored of the episode, with the states that follow from it."""
    try:
        text = await web.database.read(record_json, game.id, admin.blind)
    except (BrokenEpisode, LayoutError) as error:
        raise HTTPException(409, str(error)) from None
    headers = {"Cache-Control": "no-store", "Content-Disposition": f'inline; filename="{game.id}.json"'}
    return Response(text, media_type="application/json", headers=headers)


@router.websocket("/live")
async def follow(socket: WebSocket, name: str, episode: str, services: ServicesDep) -> None:
    """Send every new tick of a running game, and the state of the participant."""
    live = services.live
    admin = await let_in(socket)
    if admin is None:
        return
    study_ids = live.web.studies.versions(name)
    await converse(socket, _tell(socket, live, (study_ids, episode), admin), lambda _: None)


async def _tell(socket: WebSocket, live: LiveGames, which: tuple[tuple[int, ...], str], admin: AdminSession) -> None:
    sent, checked, looked = -1, time.monotonic(), 0.0
    card: Card | View | None = None
    stored, pauser = StoredTicks(live.web.database, which[1]), _Pauser(socket, live, which[1])
    while True:
        now = time.monotonic()
        if now - checked >= SESSION_EVERY_S:
            checked = now
            if not await still_in(socket, admin):
                return await socket.close(CloseCode.SIGNED_OUT, "sign in again")
        if card is None or now - looked >= STATUS_EVERY_S:
            looked = now
            card = await _status(socket, live, which)
            if card is None and await _is_over(live, which[1]):
                await send_news(socket, {"type": "over"})
                return await socket.close(CloseCode.FINISHED, "the game is over")
        await pauser.tell(now)
        if card is None:  # it is in the database alone, or another process is just taking it up
            await send_news(socket, NOT_PLAYED)
            await asyncio.sleep(STATUS_EVERY_S)
            continue
        if isinstance(card, View):
            for row in await stored.new_rows(admin.blind):
                await send_news(socket, {"type": "tick", "row": row})
            await asyncio.sleep(STORED_EVERY_S)
            continue
        session = card.game.session
        if session.stored and not card.game.busy and session.record is not None and session.simulation.timestep > sent:
            sent = session.simulation.timestep
            row = row_of(session.record, session.simulation, admin.blind)
            new = [input_of(one, session.spec.tick_ms) for one in visible(session.record.inputs, admin.blind)]
            await send_news(socket, {"type": "tick", "row": row, "inputs": new})
        await asyncio.sleep(LOOK_EVERY_S)


class _Pauser:
    """Tells an open page who pauses the game: a colleague may do so, or resume it, on another page."""

    def __init__(self, socket: WebSocket, live: LiveGames, episode: str) -> None:
        self._socket, self._live, self._episode = socket, live, episode
        self._looked_at = time.monotonic()  # the page shows it when it is loaded

    async def tell(self, now: float) -> None:
        if now - self._looked_at < PAUSED_EVERY_S:
            return
        self._looked_at = now
        with suppress(DatabaseDown):
            by = await self._live.web.database.read(interventions.pauser_of, self._episode)
            await send_news(self._socket, {"type": "paused", "by": by})


async def _is_over(live: LiveGames, episode: str) -> bool:
    """Return whether the end of the game is stored, or the game was deleted."""
    with suppress(DatabaseDown):
        played = (await live.web.database.read(overview.played, episode)).get(episode)
        return played is None or played.is_over
    return False


async def _status(socket: WebSocket, live: LiveGames, which: tuple[tuple[int, ...], str]) -> Card | View | None:
    """Describe the participant's state; None if the game no longer runs."""
    study_ids, episode = which
    card = next((one for one in await live.cards(study_ids) if one.played.id == episode), None)
    view = None if card else next((one for one in await live.views(study_ids) if one.id == episode), None)
    if card is not None:
        status = card_of(live, card, {}) | {"type": "status", "phase": card.game.session.phase}
    elif view is not None:
        status = view.card | {"type": "status", "phase": view.phase}
    else:
        return None
    await send_news(socket, status)
    return card or view
