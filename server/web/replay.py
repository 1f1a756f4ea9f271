"""One episode for researchers, live or over: simulated again from its actions, every state held against its hash.

The page plays it; this module only tells. A blinded researcher gets neither marks nor predictions.
"""

import asyncio
import json
import time
from collections.abc import Sequence
from contextlib import suppress
from typing import Any, Final

from fastapi import APIRouter, HTTPException, Request, Response, WebSocket, WebSocketDisconnect
from sqlalchemy import Connection

from overcooked.constants import EVENT_NAMES
from overcooked.layout import LayoutError, parse_layout
from server.play.recorder import EpisodeRecord, InputRecord, PauseRecord, TickRecord
from server.play.trace import Trace
from server.store import decisions, episodes, inputs, overview, ticks
from server.store.accuracy import wilson
from server.store.admins import AdminSession
from server.store.database import Database, DatabaseDown
from server.store.episodes import BrokenEpisode
from server.web.actions import REASONS, GameDep
from server.web.admin_auth import WatchDep
from server.web.admin_page import AdminPage, study_at
from server.web.deps import WebDep
from server.web.elsewhere import View
from server.web.live import SESSION_EVERY_S, Card, Live, card_of, let_in, still_in, who
from server.web.tasks import ended

router = APIRouter(prefix="/admin/s/{name}/game/{episode}")
LOOK_EVERY_S: Final = 0.05
STATUS_EVERY_S: Final = 0.5
STORED_EVERY_S: Final = 0.2
_BREATHE_EVERY: Final = 16  # timesteps: the live games' thread gets its turn in between


@router.get("")
async def page(request: Request, name: str, admin: WatchDep, web: WebDep, game: GameDep) -> Response:
    """The game as the participant sees it, its time line, and what can be done about it."""
    _, study = study_at(web, name)
    live: Live = request.app.state.live
    held = await web.database.read(decisions.exclusions_of, [game.participant_id])
    titles = {kitchen.name: kitchen.title.of("en") for kitchen in study.layouts}
    mine = await web.database.read(overview.played_by, game.participant_id)
    return AdminPage(request, admin).render(
        "game.html",
        tab="games",
        study=study,
        game=game,
        label=who(game),
        arm="" if admin.blind else game.condition,
        shown="" if admin.blind else game.shown,
        layout=titles.get(game.layout, game.layout),
        others=[one for one in mine if one.started_at is not None],
        is_live=live.games.get(game.id) is not None or await live.elsewhere_plays(game),
        exclusions=[one for one in held if one.episode_id in (None, game.id)],
        reasons=REASONS,
    )


@router.get("/record.json")
async def record(admin: WatchDep, web: WebDep, game: GameDep) -> Response:
    """Everything that is stored of the episode, with the states that follow from it."""
    try:
        text = await web.database.read(_record, game.id, admin.blind)
    except (BrokenEpisode, LayoutError) as error:
        raise HTTPException(409, str(error)) from None
    headers = {"Cache-Control": "no-store", "Content-Disposition": f'inline; filename="{game.id}.json"'}
    return Response(text, media_type="application/json", headers=headers)


def _record(connection: Connection, episode: str, blind: bool) -> str:
    """The record as JSON. Raises BrokenEpisode, LayoutError."""
    loaded = episodes.load(connection, episode)
    if loaded is None:
        raise BrokenEpisode(f"there is no episode {episode}")
    stored = ticks.of_episode(connection, episode)
    rows, difference = simulate(loaded, stored, blind)
    spec, held = loaded.spec, episodes.pauses_of(connection, episode)
    found = {
        "game": {
            "episode": episode,
            "kind": spec.kind,
            "grid": parse_layout(spec.grid, spec.layout).grid,
            "title": spec.title,
            "seat": spec.human_seats[0] if spec.human_seats else -1,
            "watched_seat": spec.watched_seat,
            "horizon": spec.horizon,
            "tick_ms": spec.tick_ms,
            "deadline_ms": spec.deadline_ms,
        },
        "status": loaded.status,
        "rows": rows,
        "pauses": [{"t": pause.timestep, "reason": pause.reason, "duration_ms": pause.duration_ms} for pause in held],
        "inputs": [input_of(one, spec.tick_ms, held) for one in inputs.of_episode(connection, episode)],
        "checked": {"states": len(stored), "equal": difference is None, "difference": difference},
        "accuracy": [] if blind else _accuracy(stored, spec.watched_seat),
    }
    return json.dumps(found, separators=(",", ":"))


def simulate(loaded: EpisodeRecord, stored: list[TickRecord], blind: bool) -> tuple[list[dict[str, Any]], str | None]:
    """A row for each stored tick, and the first difference between the rules and the record (None: all are equal)."""
    trace = Trace(parse_layout(loaded.spec.grid, loaded.spec.layout), loaded.spec.horizon)
    rows: list[dict[str, Any]] = []
    difference = None
    for tick in stored:
        if tick.timestep % _BREATHE_EVERY == 0:
            time.sleep(0)
        if tick.actions is not None:
            step = trace.step(tick.actions)
            if difference is None and (step.rewards, step.events) != (tick.rewards, tick.events):
                difference = f"timestep {tick.timestep}: other rewards or events than stored"
        if difference is None and trace.hash() != tick.state_hash:
            difference = f"timestep {tick.timestep}: the state's hash is {trace.hash()}, stored is {tick.state_hash}"
        rows.append(row_of(tick, trace, blind))
    return rows, difference


def row_of(tick: TickRecord, trace: Trace, blind: bool) -> dict[str, Any]:
    """One tick as the page takes it; `trace` stands at its state."""
    kitchen = trace.kitchen()
    return {
        "t": tick.timestep,
        "state": {name: getattr(kitchen, name) for name in ("t", "players", "counters", "pots", "score", "soups")},
        "actions": tick.actions,
        "rewards": tick.rewards,
        "events": [_names(bits) for bits in tick.events],
        "prediction": [] if blind else [[round(value, 4) for value in step] for step in tick.prediction],
        "displayed": [] if blind else tick.displayed,
        "keys": [[key.seat, key.seq, round(key.received_ms)] for key in tick.keys],
        "late": tick.late,
        "late_ms": round(tick.late_ms, 1),
        "models_ms": round(tick.models_ms, 1),
        "scheduled_ms": tick.scheduled_ms,
    }


def input_of(one: InputRecord, tick_ms: int, held: Sequence[PauseRecord] = ()) -> dict[str, Any]:
    """One input as the page takes it. `t`: the timestep in which it counted, or else in which it arrived."""
    if one.timestep is not None:
        t = one.timestep - 1
    elif one.received_ms is not None:
        t = max(0, int(one.received_ms // tick_ms))
    else:  # the game stood still: at the state of the last pause that had begun
        begun = [pause.timestep for pause in held if pause.started_at.timestamp() * 1000 <= one.received_unix_ms]
        t = begun[-1] if begun else 0
    keys = {"seat": one.seat, "seq": one.seq, "held": one.held, "tap": one.tap}
    return {"t": t, **keys, "outcome": one.outcome, "received_ms": one.received_ms}


def _names(bits: int) -> list[str]:
    return [name for bit, name in enumerate(EVENT_NAMES) if bits >> bit & 1]


def _accuracy(stored: list[TickRecord], seat: int) -> list[dict[str, Any]]:
    """For each step how often the likeliest action happened, with its interval."""
    rows = []
    for step in range(3):
        pairs = [
            (max(range(6), key=tick.prediction[step].__getitem__), stored[n + step + 1].actions)
            for n, tick in enumerate(stored)
            if tick.prediction and n + step + 1 < len(stored)
        ]
        right = sum(1 for said, done in pairs if done is not None and done[seat] == said)
        share, low, high = wilson(right, len(pairs))
        rows.append({"share": round(share, 4), "low": round(low, 4), "high": round(high, 4), "n": len(pairs)})
    return rows


@router.websocket("/live")
async def follow(socket: WebSocket, name: str, episode: str) -> None:
    """Every new tick of a running game, and how the participant is."""
    live: Live = socket.app.state.live
    admin = await let_in(socket, live)
    if admin is None:
        return
    study_ids = live.web.studies.versions(name)
    teller = asyncio.create_task(_tell(socket, live, (study_ids, episode), admin))
    try:
        while not teller.done():
            await socket.receive_text()
    except (WebSocketDisconnect, KeyError, RuntimeError):
        pass
    finally:
        await ended(teller)
        with suppress(RuntimeError, WebSocketDisconnect):
            await socket.close()


async def _tell(socket: WebSocket, live: Live, which: tuple[tuple[int, ...], str], admin: AdminSession) -> None:
    told, checked, looked = -1, time.monotonic(), 0.0
    card: Card | View | None = None
    stored = StoredTicks(live.web.database, which[1])
    while True:
        now = time.monotonic()
        if now - checked >= SESSION_EVERY_S:
            checked = now
            if not await still_in(socket, admin):
                return await socket.close(4003, "sign in again")
        if card is None or now - looked >= STATUS_EVERY_S:
            looked = now
            card = await _status(socket, live, which)
            if card is None:
                await socket.send_text('{"type":"over"}')
                return await socket.close(1000, "the game is over")
        if isinstance(card, View):
            for row in await stored.new_rows(admin.blind):
                await socket.send_text(json.dumps({"type": "tick", "row": row}, separators=(",", ":")))
            await asyncio.sleep(STORED_EVERY_S)
            continue
        session = card.game.session
        if session.stored and not card.game.busy and session.record is not None and session.trace.timestep > told:
            told = session.trace.timestep
            row = row_of(session.record, session.trace, admin.blind)
            new = [input_of(one, session.spec.tick_ms) for one in session.record.inputs]
            await socket.send_text(json.dumps({"type": "tick", "row": row, "inputs": new}, separators=(",", ":")))
        await asyncio.sleep(LOOK_EVERY_S)


async def _status(socket: WebSocket, live: Live, which: tuple[tuple[int, ...], str]) -> Card | View | None:
    """Tells how the participant is; None when the game does not run any more."""
    study_ids, episode = which
    card = next((one for one in await live.cards(study_ids) if one.played.id == episode), None)
    view = None if card else next((one for one in await live.views(study_ids) if one.id == episode), None)
    if card is not None:
        status = card_of(live, card, {}) | {"type": "status", "phase": card.game.session.phase}
    elif view is not None:
        status = view.card | {"type": "status", "phase": view.phase}
    else:
        return None
    await socket.send_text(json.dumps(status, separators=(",", ":")))
    return card or view


class StoredTicks:
    """The ticks of a game that another process plays, as they come into the database."""

    def __init__(self, database: Database, episode: str) -> None:
        self._database, self._episode = database, episode
        self._trace: Trace | None = None

    async def new_rows(self, blind: bool) -> list[dict[str, Any]]:
        """The newest at the first call, then all that came since; none while the database is away."""
        with suppress(DatabaseDown):
            return await self._database.read(self._read, blind)
        return []

    def _read(self, connection: Connection, blind: bool) -> list[dict[str, Any]]:
        if self._trace is None:
            loaded = episodes.load(connection, self._episode)
            if loaded is None or loaded.last_hash is None:
                return []
            self._trace = Trace(parse_layout(loaded.spec.grid, loaded.spec.layout), loaded.spec.horizon)
            for actions in loaded.joint_actions:
                self._trace.step(actions)
            newest = ticks.of_episode(connection, self._episode, after=self._trace.timestep - 1)
            return [row_of(newest[0], self._trace, blind)]
        rows = []
        for tick in ticks.of_episode(connection, self._episode, after=self._trace.timestep):
            if tick.actions is not None:
                self._trace.step(tick.actions)
            rows.append(row_of(tick, self._trace, blind))
        return rows
