"""Public demonstrations in which two agents cook. The games are in memory only; nothing is stored."""

import secrets
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass
from typing import Annotated, Final
from urllib.parse import urlencode

from fastapi import APIRouter, Depends, Query, Request, Response, WebSocket
from starlette.requests import HTTPConnection

from server.participation.episode_specs import layout_of, models_of, predictor_of
from server.participation.game_seats import ConnectedPlayer
from server.participation.served_studies import Studies
from server.play.episode_spec import EpisodeSpec
from server.play.games import Games, Load
from server.play.recorder import EpisodeRecord, EpisodeResult, InputRecord, PauseRecord, Recorder, TickRecord
from server.play.session import VIEWER
from server.study.definition import Condition, KitchenChoice, PartnerSettings, Study
from server.study.locale import best_language, languages
from server.web.client_address import HERE, address_of
from server.web.dependencies import WebDep, page
from server.web.participant.game_socket import IsOurs, NoPlace, Sockets
from server.web.services import ServicesDep

MAX_GAMES: Final = 12  # so that viewers never slow down participants' games
MAX_OF_ONE_ADDRESS: Final = 4  # not counted on this machine
HORIZON: Final = 400
_EPISODE: Final = "kitchenmind.watched"  # in the scope of a socket: the game that was made for it
_SHOWN: Final = Condition(name="watch", predictor="tom")


@dataclass(frozen=True)
class Offer:
    """A kitchen in which agents of one study can be watched."""

    study: Study
    kitchen: KitchenChoice
    agents: tuple[PartnerSettings, ...]

    @property
    def key(self) -> str:
        return f"{self.study.name}.{self.kitchen.name}"

    @property
    def rows(self) -> list[str]:
        """The kitchen's grid, for its picture."""
        return layout_of(self.kitchen).text.splitlines()


@dataclass(frozen=True)
class WatchRequest:
    """The chosen demonstration: the query of the page and of its socket."""

    kitchen: str = ""
    first: str = ""
    second: str = ""
    marks: int = 1  # the seat whose next steps are drawn


def choice_of(
    kitchen: str = "", first: str = "", second: str = "", marks: Annotated[int, Query(ge=0, le=1)] = 1
) -> WatchRequest:
    """Read the choice from the address; missing or unknown values become the first option."""
    return WatchRequest(kitchen[:100], first[:100], second[:100], marks)


ChoiceDep = Annotated[WatchRequest, Depends(choice_of)]


class Unstored:
    """A Recorder that keeps nothing: no participant, no data."""

    async def ticks(self, records: Sequence[TickRecord]) -> None: ...

    async def pause(self, record: PauseRecord) -> None: ...

    async def inputs(self, episode: str, records: Sequence[InputRecord]) -> None: ...

    async def end(self, result: EpisodeResult) -> None: ...


@dataclass
class Onlooker:
    """A viewer with an open socket. `spec`: the chosen game, until it is opened."""

    address: str
    spec: EpisodeSpec | None


class Demonstrations:
    """The demonstration games. Each has one viewer, and ends when that socket closes."""

    def __init__(self, make: Callable[[Recorder, Load], Games], studies: Studies, is_ours: IsOurs) -> None:
        """`make`: games with the server's clock and models, and a recorder and a reader of their own."""
        self._studies = studies
        self._onlookers: dict[str, Onlooker] = {}  # by episode, those who came first first
        self.games = make(Unstored(), self._load)
        self.sockets = Sockets(self.games, self._find, is_ours)

    def offers(self) -> list[Offer]:
        """Return every kitchen of the open studies with its agents."""
        found = [opened[1] for name in self._studies.names() if (opened := self._studies.open(name))]
        offers: dict[tuple[str, tuple[str, ...]], Offer] = {}
        for study in (study for study in found if "episodes" in study.flow):
            agents = tuple(agent for agent in study.agents if not agent.human) or (study.waiting_room.agent,)
            for kitchen in study.layouts:
                offers.setdefault((kitchen.name, tuple(agent.name for agent in agents)), Offer(study, kitchen, agents))
        most = {kitchen: max(len(names) for one, names in offers if one == kitchen) for kitchen, _ in offers}
        return [offer for (kitchen, names), offer in offers.items() if len(names) == most[kitchen]]

    def spec(self, choice: WatchRequest, language: str) -> EpisodeSpec | None:
        """Return the requested game; None if there is nothing to watch."""
        offers = self.offers()
        if not offers:
            return None
        offer = next((one for one in offers if one.key == choice.kitchen), offers[0])
        pair = [
            next((a for a in offer.agents if a.name == name), offer.agents[0]) for name in (choice.first, choice.second)
        ]
        layout = layout_of(offer.kitchen)
        predictor = predictor_of(offer.study, pair[choice.marks], _SHOWN)
        is_there = (offer.kitchen.name, predictor) in models_of(offer.study)[1]
        return EpisodeSpec(
            kind="watch",
            number=1,
            episodes=1,
            layout=layout.name,
            grid=layout.text,
            title=offer.kitchen.title.of(language),
            agents=(pair[0].catalogue_name, pair[1].catalogue_name),
            predictor=predictor if is_there else None,
            watched_seat=choice.marks,
            shown="predictor" if is_there else "nothing",
            seed=secrets.randbits(63),
            horizon=HORIZON,
            tick_ms=offer.study.game.tick_ms,
            deadline_ms=offer.study.game.deadline_ms,
        )

    async def _find(self, connection: HTTPConnection, language: str) -> ConnectedPlayer:
        given = connection.query_params
        marks = int(given.get("marks") == "1")
        choice = choice_of(given.get("kitchen", ""), given.get("first", ""), given.get("second", ""), marks)
        spec, address = self.spec(choice, language), address_of(connection)
        if spec is None or not self._make_room(address):
            raise NoPlace
        episode = f"watch-{secrets.token_hex(8)}"
        self._onlookers[episode] = Onlooker(address, spec)
        connection.scope[_EPISODE] = episode
        return ConnectedPlayer(episode, episode, VIEWER, "/watch")

    async def serve(self, socket: WebSocket, language: str) -> None:
        """Show one game from handshake to close, and clean up in any case."""
        try:
            await self.sockets.serve(socket, language)
        finally:
            self._end(socket.scope.get(_EPISODE, ""))

    def _make_room(self, address: str) -> bool:
        """Return whether there is a place. If all are taken, the viewer who has been without a running game for longest
        is disconnected."""
        own = [episode for episode, one in self._onlookers.items() if one.address == address]
        if address not in HERE and len(own) >= MAX_OF_ONE_ADDRESS:
            candidates = own
        elif len(self._onlookers) >= MAX_GAMES:
            candidates = list(self._onlookers)
        else:
            return True
        idle = next((episode for episode in candidates if not self._moves(episode)), None)
        if idle is not None:
            self.sockets.dismiss(idle, "somebody else wants to watch")
            self._end(idle)
        return idle is not None

    def _moves(self, episode: str) -> bool:
        game = self.games.get(episode)
        return game is not None and game.session.moving

    def _end(self, episode: str) -> None:
        self._onlookers.pop(episode, None)
        game = self.games.get(episode)
        if game is not None:
            self.games.abort(game, "left")

    async def _load(self, episode: str) -> EpisodeRecord | None:
        onlooker = self._onlookers.get(episode)
        if onlooker is None or onlooker.spec is None:
            return None
        spec, onlooker.spec = onlooker.spec, None
        return EpisodeRecord(episode, (None, None), spec, (), None, "new", 0.0)


router = APIRouter()


@router.get("/watch")
async def choose(request: Request, services: ServicesDep) -> Response:
    """Show the available demonstrations."""
    offers = services.demonstrations.offers()
    return page(request, services.web).render("participant/watch.html", offers=offers)


@router.get("/watch/game")
async def game(request: Request, web: WebDep, choice: ChoiceDep) -> Response:
    """Show the chosen game; the choice is in the address."""
    made = page(request, web)
    socket = "/watch/socket?" + urlencode(asdict(choice) | {"lang": made.language})
    leave = {"leave": "/watch", "leave_word": made.words("watch.others")}
    about = {"socket": socket, "lessons": (), "away_s": 30, "watched": True, **leave}
    return made.render("participant/game.html", game=about)


@router.websocket("/watch/socket")
async def watch(socket: WebSocket, services: ServicesDep) -> None:
    """Play the two agents for one onlooker."""
    wanted = socket.query_params.get("lang", "")
    language = (
        wanted if wanted in languages() else best_language(socket.headers.get("accept-language", ""), languages())
    )
    await services.demonstrations.serve(socket, language)
