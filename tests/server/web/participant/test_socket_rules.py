"""The game's websocket over a real connection: who gets in, what is refused, what closes it, and with which code."""

import asyncio
import json
import logging
import socket as sockets
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from typing import Any

import pytest
import uvicorn
from fastapi import FastAPI
from starlette.requests import HTTPConnection
from uvicorn.protocols.websockets.websockets_sansio_impl import WebSocketsSansIOProtocol
from websockets.asyncio.client import ClientConnection, connect
from websockets.exceptions import ConnectionClosed, InvalidStatus
from websockets.typing import Origin

from server.bots.cook import Traits
from server.bots.game_client import BotGame, Journal
from server.participation.seating import ConnectedPlayer
from server.play import send_queue
from server.play.clock import Clock
from server.play.game import Game
from server.play.games import Games
from server.play.messages import MAX_FRAME_BYTES, MAX_READ_BYTES
from server.play.recorder import EpisodeRecord
from server.play.token_bucket import TokenBucket
from server.store.database import DatabaseDown
from server.uvicorn_protocols import SparingProtocol
from server.web.auth import CsrfProtection
from server.web.participant import game_socket
from server.web.participant.game_socket import Sockets
from tests.support.live_fakes import MemoryRecorder, RuleModels, make_spec
from tests.support.some_services import some_services

# Half a megabyte of small messages, masked with zeros.
FLOOD = 30_000 * (bytes([0x81, 0x80 | 10, 0, 0, 0, 0]) + b'{"type":1}')
HELLO = {"type": "hello", "protocol": 1, "tab": "tab-0001"}


class Served:
    """A server on a free port with real sockets; who plays what is told by the cookie `participant=<id>`."""

    def __init__(self, clock: Clock | None = None) -> None:
        self.recorder = MemoryRecorder()
        self.spec = make_spec(horizon=0)
        self.games = Games(clock or Clock(10.0), RuleModels(), self.recorder, self.load)
        self.client_errors: list[str] = []
        self.app = FastAPI()
        self.app.include_router(game_socket.router)
        self.sockets = Sockets(self.games, self.find, CsrfProtection(b"secret").is_own_origin, self.report)
        self.app.state.services = some_services(sockets=self.sockets)
        self.url = ""
        self.database_down = False

    async def load(self, episode: str) -> EpisodeRecord | None:
        return self.recorder.load(self.spec, episode)

    async def find(self, connection: HTTPConnection, study: str) -> ConnectedPlayer | None:
        if self.database_down:
            raise DatabaseDown("switched off")
        who = connection.cookies.get("participant")
        if who is None or study != "demo":
            return None
        return ConnectedPlayer(who, None if who == "reader" else f"episode-of-{who}", 0, "/s/demo/now")

    async def report(self, participant: str, text: str) -> None:
        self.client_errors.append(f"{participant}: {text}")

    def connect(self, who: str | None = "ann", **more: Any) -> connect:
        headers = {"Cookie": f"participant={who}"} if who else {}
        return connect(self.url, additional_headers=headers, compression=None, **more)


@pytest.fixture
async def served() -> AsyncIterator[Served]:
    async with serving(Served()) as made:
        yield made


@asynccontextmanager
async def serving(made: Served) -> AsyncIterator[Served]:
    config = uvicorn.Config(
        made.app,
        ws=SparingProtocol,  # type: ignore[arg-type] # as `kitchenmind serve`
        ws_max_size=MAX_READ_BYTES,
        ws_per_message_deflate=False,
        ws_ping_interval=None,
        log_level="error",
        lifespan="off",
    )
    listening = sockets.create_server(("127.0.0.1", 0))
    made.url = f"ws://127.0.0.1:{listening.getsockname()[1]}/s/demo/socket"
    server = uvicorn.Server(config)
    server.install_signal_handlers = lambda: None  # type: ignore[attr-defined]
    task = asyncio.create_task(server.serve(sockets=[listening]))
    while not server.started:
        await asyncio.sleep(0.01)
    try:
        yield made
    finally:
        await made.games.stop()
        server.should_exit = True
        await task
        listening.close()


async def hear(socket: ClientConnection, kind: str, most: int = 200) -> dict[str, Any]:
    """The next message of a kind; Pings on the way are answered."""
    for _ in range(most):
        message = json.loads(await asyncio.wait_for(socket.recv(), 10))
        if message["type"] == kind:
            return dict(message)
        if message["type"] == "ping":
            await say(socket, type="pong", id=message["id"])
    raise AssertionError(f"no {kind}")


async def say(socket: ClientConnection, **message: Any) -> None:
    await socket.send(json.dumps(message))


async def close_code(socket: ClientConnection) -> int | None:
    """Read until the server closes."""
    try:
        async with asyncio.timeout(10):
            while True:
                await socket.recv()
    except ConnectionClosed:
        return socket.close_code


async def play(socket: ClientConnection) -> None:
    await say(socket, **HELLO)
    await hear(socket, "welcome")
    await say(socket, type="ready")
    while (await hear(socket, "tick"))["state"]["t"] == 0:
        pass


@pytest.mark.parametrize(("who", "path"), [(None, "demo"), ("ann", "other")])
async def test_unknown_people_get_403_before_anything_is_accepted(served: Served, who: str | None, path: str) -> None:
    served.url = served.url.replace("demo", path)
    with pytest.raises(InvalidStatus) as refused:
        async with served.connect(who):
            pass
    assert refused.value.response.status_code == 403


async def test_page_of_another_site_gets_403(served: Served) -> None:
    with pytest.raises(InvalidStatus) as refused:
        async with served.connect(origin=Origin("https://evil.example")):
            pass
    assert refused.value.response.status_code == 403


async def test_own_page_gets_in_and_plays(served: Served) -> None:
    origin = Origin("http" + served.url.removeprefix("ws").removesuffix("/s/demo/socket"))
    async with served.connect(origin=origin) as socket:
        await play(socket)
        assert (await hear(socket, "tick"))["state"]["t"] >= 1


async def test_compression_is_never_agreed_on(served: Served) -> None:
    async with connect(served.url, additional_headers={"Cookie": "participant=ann"}) as socket:
        assert socket.response is not None
        assert "Sec-WebSocket-Extensions" not in socket.response.headers


async def test_whoever_has_no_game_to_play_is_sent_back_to_the_page(served: Served) -> None:
    async with served.connect("reader") as socket:
        await say(socket, **HELLO)
        assert (await hear(socket, "refused"))["code"] == "no_game"
        assert await close_code(socket) == 4004


async def test_first_message_is_hello(served: Served) -> None:
    async with served.connect() as socket:
        await say(socket, type="ready")
        assert (await hear(socket, "refused"))["code"] == "hello_first"
        await play(socket)


async def test_other_protocol_version_is_refused(served: Served) -> None:
    async with served.connect() as socket:
        await say(socket, **(HELLO | {"protocol": 99}))
        assert (await hear(socket, "refused"))["code"] == "protocol"
        assert await close_code(socket) == 1008


BAD = [
    "",
    "no json",
    "[]",
    '{"type": "dance"}',
    '{"type": "input"}',
    '{"type": "input", "seq": 1, "held": 7, "tap": null, "client_ms": 1}',
    '{"type": "input", "seq": -1, "held": null, "tap": null, "client_ms": 1}',
    '{"type": "input", "seq": 1, "held": null, "tap": 6, "client_ms": 1}',
    '{"type": "input", "seq": 1, "held": null, "tap": 4, "client_ms": 1}',
    '{"type": "input", "seq": 1, "held": null, "tap": null, "client_ms": NaN}',
    '{"type": "input", "seq": 1, "held": null, "tap": null, "client_ms": 1, "more": 1}',
    '{"type": "input", "seq": "1", "held": null, "tap": null, "client_ms": 1}',
    '{"type": "away", "reason": "bored"}',
    json.dumps(HELLO | {"tab": "tab-0001\n"}),
    "[" * 500,
]


async def test_bad_messages_are_refused_and_the_game_goes_on(served: Served) -> None:
    async with served.connect() as socket:
        await play(socket)
        for bad in BAD:
            await socket.send(bad)
            assert (await hear(socket, "refused"))["code"] == "bad_message"
        assert await hear(socket, "tick")


async def test_too_many_bad_messages_close_the_socket(served: Served) -> None:
    async with served.connect() as socket:
        for _ in range(30):
            await socket.send("nonsense")
        assert await close_code(socket) == 1008


async def test_binary_frames_close_with_1003(served: Served) -> None:
    async with served.connect() as socket:
        await socket.send(b"\x00\x01")
        assert await close_code(socket) == 1003


async def test_a_text_frame_that_is_not_utf8_closes_with_1007_without_a_traceback_in_the_log(
    served: Served, caplog: pytest.LogCaptureFixture
) -> None:
    caplog.set_level(logging.DEBUG)
    async with served.connect() as socket:
        socket.transport.write(bytes([0x81, 0x80 | 2, 0, 0, 0, 0, 0xFF, 0xFE]))  # past the library, which would refuse
        async with asyncio.timeout(10):
            await socket.wait_closed()
        assert socket.close_code == 1007
    assert [record for record in caplog.records if record.exc_info] == []
    assert "not UTF-8" in caplog.text


@pytest.mark.parametrize(("size", "reason"), [(2000, f"a frame has at most {MAX_FRAME_BYTES} bytes"), (5000, None)])
async def test_oversized_frames_close_with_1009(served: Served, size: int, reason: str | None) -> None:
    """In the words of the protocol up to what is read at all, in the library's beyond."""
    async with served.connect() as socket:
        await socket.send(json.dumps(HELLO | {"tab": "x" * size}))
        assert await close_code(socket) == 1009
        assert reason is None or socket.close_reason == reason


async def test_flood_closes_with_1008_for_this_participant_only(served: Served) -> None:
    async with served.connect("ann") as flooding, served.connect("bob", max_queue=None) as calm:
        await play(calm)
        await say(flooding, **HELLO)
        for seq in range(2000):
            await say(flooding, type="input", seq=seq, held=None, tap=None, client_ms=seq)
        assert await close_code(flooding) == 1008
        assert await hear(calm, "tick")


async def test_simulated_participants_may_send_as_fast_as_the_games_that_wait_for_them() -> None:
    async with serving(Served(Clock(5.0, patience_s=2.0))) as served, served.connect("ann", max_queue=None) as socket:
        await play(socket)
        for seq in range(2000):
            await say(socket, type="input", seq=seq, held=None, tap=None, client_ms=seq)
        await say(socket, type="nothing that there is")
        assert await hear(socket, "refused", most=4000)


async def test_a_simulated_participant_who_is_taken_for_a_flood_says_so(
    served: Served, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(game_socket, "bucket_of", lambda clock: TokenBucket(clock.now(), burst=0.0))
    with pytest.raises(RuntimeError, match="closed: too many messages"):
        await BotGame(served.url, "participant=ann", Journal(), Traits.drawn(1)).play()


async def test_flood_that_goes_on_after_the_close_is_read_a_little_at_a_time(
    served: Served, monkeypatch: pytest.MonkeyPatch
) -> None:
    mouthfuls: list[int] = []
    take_in = WebSocketsSansIOProtocol.data_received

    def count(self: WebSocketsSansIOProtocol, data: bytes) -> None:
        mouthfuls.append(len(data))
        take_in(self, data)

    monkeypatch.setattr(WebSocketsSansIOProtocol, "data_received", count)
    async with served.connect() as socket:
        socket.transport.write(FLOOD)  # past the library, which would stop at the close
        while socket.protocol.close_rcvd is None:
            await asyncio.sleep(0.01)
        assert socket.protocol.close_rcvd.code == 1008
        until_closed = len(mouthfuls)
        await asyncio.sleep(0.4)
        assert max(mouthfuls) <= 4096
        assert 1 <= len(mouthfuls) - until_closed <= 25
        socket.transport.abort()


async def test_replayed_and_reordered_inputs_move_once(served: Served) -> None:
    async with served.connect() as socket:
        await play(socket)
        for seq in (5, 5, 3, 5):
            await say(socket, type="input", seq=seq, held=None, tap=2, client_ms=1.0)
        for _ in range(6):
            tick = await hear(socket, "tick")
        assert tick["applied"] == 5
    keys = [key.seq for record in served.recorder.ticks_of["episode-of-ann"].values() for key in record.keys]
    assert keys == [5]


async def test_second_tab_takes_over_and_the_first_is_closed_with_4001(served: Served) -> None:
    async with served.connect() as first, served.connect() as second:
        await play(first)
        await say(second, **(HELLO | {"tab": "tab-0002"}))
        assert await close_code(first) == 4001
        welcome = await hear(second, "welcome")
        assert welcome["resumed"]
        assert (await hear(second, "paused"))["reason"] == "other_tab"
        await say(second, type="ready")
        assert (await hear(second, "tick"))["state"]["t"] >= welcome["state"]["t"]


async def test_lost_socket_pauses_and_hello_brings_the_same_timestep_back(served: Served) -> None:
    async with served.connect() as socket:
        await play(socket)
        await hear(socket, "tick")
    game = served.games.get("episode-of-ann")
    assert game is not None
    async with asyncio.timeout(5):
        while game.session.moving or game.busy:
            await asyncio.sleep(0.01)
    stood = game.session.simulation.timestep
    async with served.connect() as socket:
        await say(socket, **HELLO)
        assert (await hear(socket, "welcome"))["state"]["t"] == stood
        assert (await hear(socket, "paused"))["reason"] == "lost"


async def test_trouble_in_the_browser_reaches_the_researcher(served: Served) -> None:
    async with served.connect() as socket:
        await say(socket, type="trouble", text="TypeError: x is undefined")
        async with asyncio.timeout(5):
            while not served.client_errors:
                await asyncio.sleep(0.01)
    assert served.client_errors == ["ann: TypeError: x is undefined"]


async def test_a_page_that_breaks_over_and_over_is_reported_a_few_times(served: Served) -> None:
    told = int(game_socket.CLIENT_ERRORS_BURST)
    for _ in range(3):  # also when it connects again
        async with served.connect() as socket:
            for number in range(12):
                await say(socket, type="trouble", text=f"error {number}")
            await say(socket, **HELLO)
            async with asyncio.timeout(10):
                while json.loads(await socket.recv())["type"] != "welcome":
                    pass
    assert len(served.client_errors) == told
    async with served.connect("ben") as socket:
        await say(socket, type="trouble", text="another")
        async with asyncio.timeout(10):
            while len(served.client_errors) == told:
                await asyncio.sleep(0.01)
    assert served.client_errors[-1] == "ben: another"


async def test_round_trip_is_measured(served: Served) -> None:
    async with served.connect() as socket:
        ping = await hear(socket, "ping")
        await say(socket, type="pong", id=ping["id"])
        async with asyncio.timeout(5):
            while "ann" not in served.sockets.rtts_ms():
                await asyncio.sleep(0.01)
    assert served.sockets.rtts_ms().get("ann", 1.0) > 0


async def test_peer_that_answers_nothing_is_given_up_and_its_game_pauses(
    served: Served, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(send_queue, "DEAD_AFTER_S", 0.5)
    async with served.connect(max_queue=None) as socket:
        await say(socket, **HELLO)
        await say(socket, type="ready")
        async with asyncio.timeout(20):
            while len(served.sockets) or not len(served.games):
                await asyncio.sleep(0.01)
        game = served.games.get("episode-of-ann")
        assert game is not None
        assert not game.connections
        assert not game.session.moving
        assert await close_code(socket) == 1001, "the page connects again: 1000 would say that the episode is over"
        assert socket.close_reason == "no answer to a ping"


async def test_an_input_that_is_sent_again_after_a_lost_connection_moves_once(served: Served) -> None:
    press = {"type": "input", "seq": 5, "held": None, "tap": 2, "client_ms": 1.0}
    async with served.connect() as socket:
        await play(socket)
        await say(socket, **press)
        while (await hear(socket, "tick"))["applied"] != 5:
            pass
    async with served.connect() as socket:
        await say(socket, **HELLO, last_timestep=1)
        await hear(socket, "welcome")
        await say(socket, type="ready")
        await hear(socket, "countdown")
        await hear(socket, "tick")
        moved = await hear(socket, "tick")  # the game moves
        await say(socket, **press)
        for _ in range(6):
            tick = await hear(socket, "tick")
        assert tick["state"]["t"] > moved["state"]["t"]
        assert tick["applied"] == 5
    keys = [key.seq for record in served.recorder.ticks_of["episode-of-ann"].values() for key in record.keys]
    assert keys == [5]


async def test_times_are_told_in_the_time_of_the_page(served: Served) -> None:
    async with served.connect() as socket:  # the clock of these games is ten times as fast
        await say(socket, **HELLO)
        assert (await hear(socket, "welcome"))["tick_ms"] == 20
        await say(socket, type="ready")
        assert (await hear(socket, "countdown"))["seconds"] == pytest.approx(0.3)
        await hear(socket, "tick")
        await say(socket, type="away", reason="blur")
        assert 0 < (await hear(socket, "paused"))["left_s"] <= 3


async def test_a_fault_of_the_server_closes_with_1011(served: Served, monkeypatch: pytest.MonkeyPatch) -> None:
    async with served.connect() as socket:
        await play(socket)
        monkeypatch.setattr(Game, "receive", lambda *_: 1 / 0)
        await say(socket, type="away", reason="blur")
        assert await close_code(socket) == 1011


async def test_database_away_at_the_handshake_asks_the_page_to_come_back(served: Served) -> None:
    served.database_down = True
    async with served.connect() as socket:
        assert await close_code(socket) == 1013


async def test_a_hundred_reconnects_leave_no_ghost(served: Served) -> None:
    for _ in range(100):
        async with served.connect() as socket:
            await say(socket, **HELLO)
            await hear(socket, "welcome")
    async with asyncio.timeout(5):
        while len(served.sockets):
            await asyncio.sleep(0.01)
    assert len(served.games) == 1
