"""The game's websocket over a real connection: access, the effect of messages, and close codes."""

import asyncio

import pytest
from websockets.asyncio.client import connect
from websockets.exceptions import InvalidStatus
from websockets.typing import Origin

from server.play import send_queue
from server.play.game import Game
from tests.support.served_sockets import HELLO, Served, close_code, hear, play, say


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


@pytest.mark.parametrize(("who", "path"), [(None, "demo"), ("ann", "other")])
async def test_own_page_with_a_cookie_that_does_not_count_is_told_to_load_the_current_step(
    served: Served, who: str | None, path: str
) -> None:
    """A browser reports a refused handshake as a lost connection: the page would try again forever."""
    origin = own_origin(served)
    served.url = served.url.replace("demo", path)
    async with served.connect(who, origin=origin) as socket:
        assert await close_code(socket) == 4004
    assert not len(served.sockets)


async def test_page_of_another_site_without_a_cookie_gets_403(served: Served) -> None:
    with pytest.raises(InvalidStatus) as refused:
        async with served.connect(None, origin=Origin("https://evil.example")):
            pass
    assert refused.value.response.status_code == 403


async def test_sockets_of_a_deleted_participant_close_for_good(served: Served) -> None:
    async with served.connect("ann") as deleted, served.connect("bob") as other:
        await play(deleted)
        await play(other)
        served.sockets.dismiss_deleted("ann")
        assert await close_code(deleted) == 4004
        assert await hear(other, "tick")


async def test_a_page_that_comes_while_the_server_stops_connects_again(served: Served) -> None:
    """With 4004 it would load itself again, from a server that is gone a moment later."""
    served.games.stopping = True
    async with served.connect("ann") as socket:
        await say(socket, **HELLO)
        assert await close_code(socket) == 1012


def own_origin(served: Served) -> Origin:
    return Origin("http" + served.url.removeprefix("ws").removesuffix("/s/demo/socket"))


async def test_own_page_gets_in_and_plays(served: Served) -> None:
    origin = own_origin(served)
    async with served.connect(origin=origin) as socket:
        await play(socket)
        assert (await hear(socket, "tick"))["state"]["t"] >= 1


async def test_compression_is_never_agreed_on(served: Served) -> None:
    async with connect(served.url, additional_headers={"Cookie": "participant=ann"}) as socket:
        assert socket.response is not None
        assert "Sec-WebSocket-Extensions" not in socket.response.headers


async def test_without_a_game_to_play_the_page_is_reloaded(served: Served) -> None:
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


async def test_replayed_and_reordered_inputs_move_once(served: Served) -> None:
    async with served.connect() as socket:
        await play(socket)
        for seq in (5, 5, 3, 5):
            await say(socket, type="input", seq=seq, held=None, tap=2, client_ms=1.0)
        while (tick := await hear(socket, "tick"))["applied"] < 5:
            pass
        for _ in range(5):
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


async def test_an_error_in_the_browser_reaches_the_researcher(served: Served) -> None:
    async with served.connect() as socket:
        await say(socket, type="trouble", text="TypeError: x is undefined")
        async with asyncio.timeout(5):
            while not served.client_errors:
                await asyncio.sleep(0.01)
    assert served.client_errors == ["ann: TypeError: x is undefined"]


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


async def test_times_are_given_in_the_time_of_the_page(served: Served) -> None:
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


@pytest.mark.parametrize("space", ["", " "])
async def test_a_fault_of_the_server_in_a_key_closes_with_1011(
    served: Served, monkeypatch: pytest.MonkeyPatch, space: str
) -> None:
    async with served.connect() as socket:
        await play(socket)
        monkeypatch.setattr(Game, "receive", lambda *_: 1 / 0)
        await socket.send(f'{{"type":{space}"input","seq":1,"held":null,"tap":5,"client_ms":1}}')
        assert await close_code(socket) == 1011


async def test_keys_keep_their_order_however_a_page_writes_them(served: Served) -> None:
    """As browsers write them they are taken at once, with spaces by the reader's task."""
    async with served.connect() as socket:
        await play(socket)
        for seq in range(1, 31):
            space = " " * (seq % 3 == 0)
            await socket.send(f'{{"type":{space}"input","seq":{seq},"held":null,"tap":5,"client_ms":1}}')
        while (await hear(socket, "tick"))["applied"] < 30:
            pass
        await asyncio.sleep(0.1)
    stored = [one for records in served.recorder.ticks_of.values() for tick in records.values() for one in tick.inputs]
    assert sorted((one.number, one.seq) for one in stored)[:29] == [(seq, seq) for seq in range(1, 30)]
    assert "repeated" not in {one.outcome for one in stored}


def _frame(text: str, first_byte: int = 0x81) -> bytes:
    """A frame as a browser masks it, here with zeros."""
    return bytes([first_byte, 0x80 | len(text), 0, 0, 0, 0]) + text.encode()


def _tap(seq: int) -> str:
    return f'{{"type":"input","seq":{seq},"held":null,"tap":5,"client_ms":1}}'


async def test_keys_count_once_however_the_network_cuts_their_frames(served: Served) -> None:
    """Whole ones are read at once; from the first that is cut on, the websocket library reads."""
    async with served.connect() as socket:
        await play(socket)
        frames = [_frame(_tap(seq)) for seq in range(1, 7)]
        pieces = [b"".join(frames[:2]), frames[2] + frames[3][:2], frames[3][2:9], frames[3][9:] + frames[4], frames[5]]
        for piece in pieces:
            socket.transport.write(piece)
            await asyncio.sleep(0.02)
        while (await hear(socket, "tick"))["applied"] < 6:
            pass
    stored = [one for records in served.recorder.ticks_of.values() for tick in records.values() for one in tick.inputs]
    assert {"repeated", "forgotten"}.isdisjoint(one.outcome for one in stored)
    assert [one.seq for one in sorted(stored, key=lambda one: one.number)] == list(range(1, len(stored) + 1))


async def test_a_key_in_the_middle_of_another_message_closes_with_1002(served: Served) -> None:
    async with served.connect() as socket:
        await play(socket)
        socket.transport.write(_frame(_tap(1)) + _frame("{", first_byte=0x01) + _frame(_tap(2)))
        assert await close_code(socket) == 1002


async def test_a_ping_of_the_page_is_answered_between_keys(served: Served) -> None:
    async with served.connect() as socket:
        await play(socket)
        pong = await socket.ping("beat")
        await socket.send(_tap(1))
        await asyncio.wait_for(pong, 10)
        while (await hear(socket, "tick"))["applied"] < 1:
            pass


async def test_an_unavailable_database_at_the_handshake_makes_the_page_reconnect(served: Served) -> None:
    served.database_down = True
    async with served.connect() as socket:
        assert await close_code(socket) == 1013


async def test_a_hundred_reconnects_leave_no_connection_behind(served: Served) -> None:
    for _ in range(100):
        async with served.connect() as socket:
            await say(socket, **HELLO)
            await hear(socket, "welcome")
    async with asyncio.timeout(5):
        while len(served.sockets):
            await asyncio.sleep(0.01)
    assert len(served.games) == 1
