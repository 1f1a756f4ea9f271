"""Rounds that are played in the preview of a draft: against the real agents, in memory only; nothing is stored."""

import secrets
from collections.abc import Callable
from typing import Final

from fastapi import WebSocket
from starlette.requests import HTTPConnection

from server.participation.game_seats import ConnectedPlayer
from server.participation.preview_models import PreviewModels
from server.play.close_codes import CloseCode
from server.play.episode_spec import EpisodeSpec
from server.play.games import Games, Load
from server.play.recorder import EpisodeRecord, Recorder
from server.web.participant.game_socket import IsOurs, Sockets
from server.web.participant.watch_agents import Unstored

MAX_GAMES: Final = 4  # at a time, so that researchers never take the time of participants
_PLAYER: Final = "kitchenmind.previewing"  # in the scope of a socket: who plays on it


class PreviewGames:
    """The games of researchers who try a draft. Each belongs to one socket, and ends when that closes."""

    def __init__(self, make: Callable[[Recorder, Load], Games], is_ours: IsOurs, models: PreviewModels) -> None:
        """`make`: games with the server's clock and models, and a recorder and a reader of their own. `models`: to load
        what a game asks, before it."""
        self.models = models
        self._specs: dict[str, EpisodeSpec] = {}
        self.games = make(Unstored(), self._load)
        self.sockets = Sockets(self.games, self._find, is_ours)

    async def serve(self, socket: WebSocket, spec: EpisodeSpec, next_url: str) -> None:
        """Play one round from handshake to close, then remove everything about it, whatever the socket did."""
        if len(self._specs) >= MAX_GAMES:
            return await socket.close(CloseCode.TRY_LATER)
        episode = f"preview-{secrets.token_hex(8)}"
        self._specs[episode] = spec
        socket.scope[_PLAYER] = ConnectedPlayer(episode, episode, spec.agents.index(None), next_url)
        try:
            await self.sockets.serve(socket, "")
        finally:
            self._specs.pop(episode, None)
            game = self.games.get(episode)
            if game is not None:
                self.games.abort(game, "left")

    async def _find(self, connection: HTTPConnection, _: str) -> ConnectedPlayer | None:
        player: ConnectedPlayer | None = connection.scope.get(_PLAYER)
        return player

    async def _load(self, episode: str) -> EpisodeRecord | None:
        spec = self._specs.get(episode)
        if spec is None:
            return None
        people = tuple(episode if agent is None else None for agent in spec.agents)
        return EpisodeRecord(episode, (people[0], people[1]), spec, (), None, "new", 0.0)
