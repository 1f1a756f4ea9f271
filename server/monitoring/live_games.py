"""The running games as researchers see them: a card for each game, and its board. Read-only."""

import asyncio
import time
from collections import deque
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Final

import msgspec

from server.monitoring.interfaces import MonitoredServer, OpenSockets
from server.monitoring.needs_attention import Attention, Flag
from server.monitoring.peers import Peers, SingleProcess, View
from server.play.game import Game
from server.play.games import Games
from server.play.intentions import hidden
from server.play.marks import Displayed
from server.store import overview, participants
from server.store.overview import Played

CARDS_EVERY_S: Final = 0.5
_SAMPLES: Final = 4000


@dataclass(frozen=True)
class Card:
    """One running game and its participant; of two, the one who needs attention most."""

    game: Game
    played: Played
    people: tuple[str, ...]  # the ids of all its participants
    flag: Flag
    rtt_ms: float | None


class LiveGames:
    """Reads the running games for all open dashboards; made once in server.main."""

    def __init__(self, web: MonitoredServer, games: Games, sockets: OpenSockets, peers: Peers | None = None) -> None:
        self.web, self.games, self.sockets = web, games, sockets
        self.peers = peers or SingleProcess()
        self.models_ms: deque[float] = deque(maxlen=_SAMPLES)  # sampled while a dashboard is open
        self._attention = Attention()
        self._players: dict[str, tuple[Played, ...]] = {}
        self._cards: tuple[float, list[Card]] = (-1e9, [])
        self._views: tuple[float, list[View]] = (-1e9, [])
        self._looking = asyncio.Lock()
        self._boards: dict[tuple[str, bool], tuple[int, Displayed, msgspec.Raw]] = {}

    async def cards(self, study_ids: tuple[int, ...]) -> list[Card]:
        """Return the running games of a study; refreshed at most twice a second, however many pages are open."""
        async with self._looking:
            if time.monotonic() - self._cards[0] >= 0.8 * CARDS_EVERY_S:
                await self._sample()
        return [card for card in self._cards[1] if card.played.study_id in study_ids]

    async def views(self, study_ids: tuple[int, ...]) -> list[View]:
        """Return the games of a study that other processes play; requested at most twice a second."""
        async with self._looking:
            if time.monotonic() - self._views[0] >= 0.8 * CARDS_EVERY_S:
                self._views = (time.monotonic(), await self.peers.views())
        return [view for view in self._views[1] if view.study_id in study_ids]

    async def peer_plays(self, played: Played) -> bool:
        """Return whether another process plays the episode."""
        return any(view.id == played.id for view in await self.views((played.study_id,)))

    async def own_views(self) -> list[View]:
        """Return the games of this process, for the dashboards of others."""
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
                    display_violations=card.game.session.frames.violations,
                    display_late=card.game.session.frames.late_violations,
                )
            )
            await asyncio.sleep(0)  # let the games' ticks run first
        return made

    async def _sample(self) -> None:
        running = [game for game in self.games if game.session.phase != "ended"]
        known = {game.episode for game in running}
        unknown = [episode for episode in known if episode not in self._players]
        if unknown:
            self._players |= await self.web.database.read(overview.players, *unknown)
        self._players = {episode: players for episode, players in self._players.items() if episode in known}
        self._attention.forget(known)
        self._boards = {key: board for key, board in self._boards.items() if key[0] in known}
        rtts, now = self.sockets.rtts_ms(), self.games.clock.now()
        cards = []
        for game in running:
            if players := self._players.get(game.episode):
                cards.append(self._card(game, players, rtts, now))
            record = game.session.record
            if record is not None and game.session.phase == "running":
                self.models_ms.append(record.models_ms)
        self._cards = (time.monotonic(), cards)

    def _card(self, game: Game, players: Sequence[Played], rtts: Mapping[str, float], now: float) -> Card:
        flags = [self._attention.flag(game, one.seat, rtts.get(one.participant_id), now) for one in players]
        played, flag = max(zip(players, flags, strict=True), key=lambda pair: pair[1].level)
        people = tuple(one.participant_id for one in players)
        return Card(game, played, people, flag, rtts.get(played.participant_id))

    def encoded_board(self, game: Game, blind: bool) -> msgspec.Raw:
        """Return `board_of` as JSON, made once per timestep however many pages show it."""
        session, key = game.session, (game.episode, blind)
        timestep, displayed = session.simulation.timestep, session.frames.displayed
        kept = self._boards.get(key)
        if kept is None or kept[0] != timestep or kept[1] is not displayed:
            encoded = msgspec.Raw(msgspec.json.encode(board_of(game, blind)))
            kept = self._boards[key] = (timestep, displayed, encoded)
        return kept[2]

    def since_s(self, flag: Flag) -> int | None:
        """Return for how many seconds the flag has been set."""
        return None if flag.since is None else max(0, round(self.games.clock.now() - flag.since))


def who(played: Played) -> str:
    """Return the label of the participant who plays or played."""
    return participants.label(played.number, played.simulated)


def card_of(live: LiveGames, card: Card, arms: dict[str, str]) -> dict[str, Any]:
    """Return the data of a game's card, without its board. `arms`: the name of each condition; empty in blind mode."""
    session, played = card.game.session, card.played
    return {
        "id": played.id,
        "who": who(played),
        "person": played.participant_id,
        "people": list(card.people),
        "episode": played.short_name,
        "agent": played.agent,
        "title": session.spec.title,
        "arm": arms.get(played.condition, ""),
        "t": session.simulation.timestep,
        "horizon": session.spec.horizon,
        "score": session.simulation.score,
        "level": card.flag.level,
        "flag": card.flag.word,
        "since_s": live.since_s(card.flag),
        "rtt_ms": None if card.rtt_ms is None else round(card.rtt_ms),
    }


def kitchen_of(game: Game) -> dict[str, Any]:
    """Return the current state as the browser draws it."""
    kitchen = game.session.simulation.kitchen()
    return {name: getattr(kitchen, name) for name in ("t", "players", "counters", "pots", "score", "soups")}


def board_of(game: Game, blind: bool) -> dict[str, Any]:
    """Return the current state with the marks that the participant sees."""
    session = game.session
    board = {
        "state": kitchen_of(game),
        "prediction": session.frames.displayed,
        "intention": session.frames.intention,
        "actions": session.simulation.last_actions or (4, 4),
    }
    return blinded(board) if blind else board


def blinded(board: dict[str, Any]) -> dict[str, Any]:
    """Return a board, also one of another process, without what reveals the condition."""
    return board | {"prediction": [], "intention": hidden(board["intention"])}


def still_of(card: Card) -> dict[str, Any]:
    """Return the part of a board that never changes."""
    session = card.game.session
    return {
        "grid": session.simulation.layout.grid,
        "seat": card.played.seat,
        "watched_seat": session.spec.watched_seat,
        "tick_ms": session.spec.tick_ms,
        "horizon": session.spec.horizon,
    }
