"""What a game's websocket refuses: bad messages, wrong frames, floods."""

import asyncio
import json
import logging

import pytest
from uvicorn.protocols.websockets.websockets_sansio_impl import WebSocketsSansIOProtocol

from server.bots.cook import Traits
from server.bots.game_client import BotGame, Journal
from server.play.clock import Clock
from server.play.messages import MAX_FRAME_BYTES
from server.play.token_bucket import TokenBucket
from server.web.participant import game_socket
from tests.support.served_sockets import HELLO, Served, close_code, hear, play, say, serving

# Half a megabyte of small messages, masked with zeros.
FLOOD = 30_000 * (bytes([0x81, 0x80 | 10, 0, 0, 0, 0]) + b'{"type":1}')
NOTHING = bytes([0x80, 0, 0, 0, 0])  # the rest of an empty frame
PINGS, PONGS, PIECES = (count * (bytes([first]) + NOTHING) for count, first in ((500, 0x89), (500, 0x8A), (500, 0x00)))


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


async def test_bad_messages_are_refused_and_the_game_continues(served: Served) -> None:
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


WRONG = bytes([0x81, 0x80 | 2, 0, 0, 0, 0, 0xFF, 0xFE])
LONG_WRONG = bytes([0x81, 0x80 | 126, 0, 130, 0, 0, 0, 0]) + b"\xff" * 130
CLOSE = bytes([0x88]) + NOTHING


@pytest.mark.parametrize(
    ("sent", "code"),
    [(WRONG, 1007), (WRONG + CLOSE, 1007), (LONG_WRONG, 1007), (LONG_WRONG + CLOSE, 1005)],
    ids=["short", "short, then a close", "long", "long, then a close"],
)
async def test_a_text_frame_that_is_not_utf8_closes_with_1007_without_a_traceback_in_the_log(
    served: Served, caplog: pytest.LogCaptureFixture, sent: bytes, code: int
) -> None:
    """The websocket library reads long frames, together with a close behind them, which is then answered instead."""
    caplog.set_level(logging.DEBUG)
    async with served.connect() as socket:
        socket.transport.write(sent)  # past the library, which would refuse
        async with asyncio.timeout(10):
            await socket.wait_closed()
        assert socket.close_code == code
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


async def test_flood_as_a_browser_writes_it_closes_with_1008_too(served: Served) -> None:
    async with served.connect() as socket:
        await play(socket)
        for seq in range(2000):
            await socket.send(f'{{"type":"input","seq":{seq},"held":null,"tap":null,"client_ms":1}}')
        assert await close_code(socket) == 1008


@pytest.mark.parametrize("flood", [PINGS, PONGS, bytes([0x01]) + NOTHING + PIECES], ids=["pings", "pongs", "pieces"])
async def test_flood_of_frames_that_are_not_messages_closes_with_1008(served: Served, flood: bytes) -> None:
    async with served.connect() as socket:
        await play(socket)
        socket.transport.write(flood)
        assert await close_code(socket) == 1008


async def test_the_rate_limit_of_simulated_participants_grows_with_the_speed_of_their_games() -> None:
    async with serving(Served(Clock(5.0, patience_s=2.0))) as served, served.connect("ann", max_queue=None) as socket:
        await play(socket)
        for seq in range(2000):
            await say(socket, type="input", seq=seq, held=None, tap=None, client_ms=seq)
        await say(socket, type="nothing that there is")
        assert await hear(socket, "refused", most=4000)


async def test_a_simulated_participant_that_is_disconnected_for_flooding_reports_it(
    served: Served, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(game_socket, "bucket_of", lambda clock: TokenBucket(clock.now(), burst=0.0))
    with pytest.raises(RuntimeError, match="closed: too many messages"):
        await BotGame(served.url, "participant=ann", Journal(), Traits.drawn(1)).play()


async def test_flood_that_continues_after_the_close_is_read_a_little_at_a_time(
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
