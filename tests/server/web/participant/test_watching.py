"""Viewers of two agents over real sockets: whatever their sockets do, the next viewer finds a place."""

import asyncio
import json
import re
from collections import Counter
from collections.abc import AsyncIterator, Iterator
from contextlib import AsyncExitStack, asynccontextmanager

import httpx
import pytest
from websockets.asyncio.client import ClientConnection, connect
from websockets.exceptions import ConnectionClosed, InvalidStatus

from server.web.participant.watch_agents import MAX_GAMES, MAX_OF_ONE_ADDRESS, Demonstrations
from tests.support.live_server import LiveServer
from tests.support.real_server import ROOT, SHORT_STUDY

PUBLIC = "https://lab.example.org"
HELLO = json.dumps({"type": "hello", "protocol": 1, "tab": "tab-0001"})


@pytest.fixture(scope="module")
def live(tmp_path_factory: pytest.TempPathFactory) -> Iterator[LiveServer]:
    """Behind a proxy, so that onlookers have addresses."""
    study = SHORT_STUDY.replace("planner}", "planner, predictor: random}")
    with LiveServer(tmp_path_factory.mktemp("watching"), 1.0, study, mode="production", public_url=PUBLIC) as running:
        yield running


@asynccontextmanager
async def onlooker(live: LiveServer, address: str = "127.0.0.1", hello: bool = True) -> AsyncIterator[ClientConnection]:
    headers = {"x-forwarded-for": address}
    url = live.url.replace("http", "ws") + "/watch/socket"
    async with connect(url, additional_headers=headers, origin=PUBLIC) as socket:  # type: ignore[arg-type]
        if hello:
            await socket.send(HELLO)
            await heard(socket, "welcome")
        yield socket


async def heard(socket: ClientConnection, kind: str) -> None:
    """Answer what the server asks until a message of this kind comes."""
    async with asyncio.timeout(60):
        while (message := json.loads(await socket.recv()))["type"] != kind:
            if message["type"] == "ping":
                await socket.send(json.dumps({"type": "pong", "id": message["id"]}))


async def until_nothing_is_left(live: LiveServer) -> None:
    demonstrations: Demonstrations = live.app.state.services.demonstrations
    async with asyncio.timeout(60):
        while demonstrations._onlookers or len(demonstrations.games) or len(demonstrations.sockets):
            await asyncio.sleep(0.02)


@pytest.mark.parametrize("hello", [False, True], ids=["before hello", "after hello"])
async def test_sockets_that_close_early_take_no_place(live: LiveServer, hello: bool) -> None:
    for _ in range(MAX_GAMES + 2):
        async with onlooker(live, hello=hello):
            pass
    async with onlooker(live):
        pass
    await until_nothing_is_left(live)


async def test_a_viewer_without_a_running_game_makes_room(live: LiveServer) -> None:
    async with AsyncExitStack() as stack:
        first, *held = [await stack.enter_async_context(onlooker(live, hello=False)) for _ in range(MAX_GAMES)]
        await stack.enter_async_context(onlooker(live))
        with pytest.raises(ConnectionClosed):
            await asyncio.wait_for(drained(first), 60)
        assert first.close_code == 1008
        assert all(one.close_code is None for one in held)
    await until_nothing_is_left(live)


async def drained(socket: ClientConnection) -> None:
    while True:
        await socket.recv()


async def test_one_address_does_not_take_all_places(live: LiveServer) -> None:
    async with AsyncExitStack() as stack:
        for _ in range(MAX_OF_ONE_ADDRESS):
            await running(await stack.enter_async_context(onlooker(live, "203.0.113.9")))
        with pytest.raises(InvalidStatus, match="403"):
            await stack.enter_async_context(onlooker(live, "203.0.113.9"))
        await running(await stack.enter_async_context(onlooker(live, "198.51.100.7")))
    await until_nothing_is_left(live)


async def running(socket: ClientConnection) -> None:
    """The game has begun."""
    await socket.send(json.dumps({"type": "ready"}))
    await heard(socket, "tick")


def test_kitchens_are_pictured_and_agents_have_their_names(live: LiveServer) -> None:
    page = httpx.get(f"{live.url}/watch", headers={"accept": "text/html"}).text
    (picture, *_) = re.findall(r'<svg class="kitchen" .*?aria-label="([^"]+)">(.*?)</svg>', page, re.DOTALL)
    assert picture[0] == "Ring"
    drawn = Counter(re.findall(r'href="/static/sprites/([a-z-]+).svg"', picture[1]))
    assert (drawn["counter"], drawn["pot-empty"], drawn["station-onion"]) == (17, 2, 2)
    assert (drawn["chef-blue-down"], drawn["chef-green-down"]) == (1, 1)
    assert all((ROOT / "static" / "sprites" / f"{name}.svg").is_file() for name in drawn)
    assert "Scripted planner</option>" in page


def test_start_page_pictures_the_kitchens_of_each_study(live: LiveServer) -> None:
    page = httpx.get(live.url, headers={"accept": "text/html"}).text
    assert page.count('<svg class="kitchen"') == len(live.app.state.services.web.studies.open("short")[1].layouts)
