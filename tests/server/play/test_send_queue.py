"""The queue for one browser: short, the newest state replaces older ones, and not forever."""

import asyncio

import msgspec
from hypothesis import given
from hypothesis import strategies as st

from server.play.messages import Countdown, KitchenState, Notice, Tick
from server.play.send_queue import DEAD_AFTER_S, PING_EVERY_S, SLOW_AFTER_S, Close, SendQueue


def state(timestep: int) -> Tick:
    return Tick(KitchenState(timestep, (), (), (), 0, 0), (), (4, 4), -1, late=False)


async def waiting(send_queue: SendQueue) -> list[object]:
    """Everything that can be sent now, as type or timestep."""
    out: list[object] = []
    while True:
        try:
            frame = await asyncio.wait_for(send_queue.next(), 0.01)
        except TimeoutError:
            return out
        if isinstance(frame, Close):
            return [*out, frame.code]
        message = msgspec.json.decode(frame)
        out.append(message["state"]["t"] if message["type"] == "tick" else message["type"])


async def test_newer_state_replaces_the_one_that_waits() -> None:
    send_queue = SendQueue()
    for timestep in range(100):
        send_queue.send(state(timestep))
    assert await waiting(send_queue) == [99]
    assert send_queue.dropped == 99


async def test_other_messages_keep_their_place() -> None:
    send_queue = SendQueue()
    send_queue.send(state(1))
    send_queue.send(Countdown(3))
    send_queue.send(state(2))
    send_queue.send(Notice("hello"))
    assert await waiting(send_queue) == ["countdown", 2, "notice"]


async def test_line_that_grows_without_states_is_closed() -> None:
    send_queue = SendQueue()
    for _ in range(100):
        send_queue.send(Notice("again"))
    told = await waiting(send_queue)
    assert told[-1] == 1008
    assert len(told) < 20


async def test_slow_reader_gets_only_the_newest_state_once_it_answers() -> None:
    send_queue = SendQueue()
    send_queue.beat(0.0)
    assert await waiting(send_queue) == ["ping"]
    assert not send_queue.beat(SLOW_AFTER_S + 0.1)
    for timestep in range(5):
        send_queue.send(state(timestep))
    assert await waiting(send_queue) == []
    assert send_queue.pong(1, 1.0)
    assert await waiting(send_queue) == [4]
    assert send_queue.rtt_ms == 1000.0


async def test_silent_peer_is_given_up() -> None:
    send_queue = SendQueue()
    assert not send_queue.beat(0.0)
    assert not send_queue.beat(DEAD_AFTER_S - 0.1)
    assert send_queue.beat(DEAD_AFTER_S + 0.1)


async def test_pings_come_regularly_while_they_are_answered() -> None:
    send_queue = SendQueue()
    now = 0.0
    for number in range(1, 4):
        send_queue.beat(now)
        assert await waiting(send_queue) == ["ping"]
        assert send_queue.pong(number, now + 0.05)
        now += PING_EVERY_S


async def test_an_unsolicited_answer_is_not_a_sign_of_life() -> None:
    send_queue = SendQueue()
    send_queue.beat(0.0)
    assert not send_queue.pong(77, 0.1)
    assert send_queue.beat(DEAD_AFTER_S + 0.1)


async def test_last_messages_are_sent_before_the_close_even_to_a_slow_reader() -> None:
    send_queue = SendQueue()
    send_queue.beat(0.0)
    send_queue.beat(SLOW_AFTER_S + 0.1)
    send_queue.send(state(7))
    send_queue.close(1000, "done")
    send_queue.send(Notice("too late"))
    assert await waiting(send_queue) == ["ping", 7, 1000]


@given(st.lists(st.sampled_from(["state", "notice", "take"]), max_size=200))
def test_line_never_holds_more_than_one_state_and_states_never_go_back(events: list[str]) -> None:
    async def run() -> None:
        send_queue = SendQueue()
        timestep = 0
        seen: list[int] = []
        for event in events:
            if event == "state":
                timestep += 1
                send_queue.send(state(timestep))
            elif event == "notice":
                send_queue.send(Notice("x"))
            elif send_queue._line:
                frame = await send_queue.next()
                assert isinstance(frame, bytes)
                message = msgspec.json.decode(frame)
                if message["type"] == "tick":
                    seen.append(message["state"]["t"])
            assert sum(is_state for is_state, _ in send_queue._line) <= 1
            assert len(send_queue._line) <= 17
        assert seen == sorted(set(seen))

    asyncio.run(run())


async def test_a_message_that_nothing_is_in_front_of_goes_out_at_once_and_the_others_in_order() -> None:
    written: list[bytes] = []
    is_full = False

    def write(frame: bytes) -> bool:
        if not is_full:
            written.append(frame)
        return not is_full

    send_queue = SendQueue(write)
    send_queue.send(Notice("before the writer is there"))
    assert written == []
    writer = asyncio.create_task(send_queue.next())
    assert b"before" in bytes(await writer)  # type: ignore[arg-type]
    send_queue.send(state(1))  # the writer still has the notice in hand: nothing may overtake it
    assert await waiting(send_queue) == [1]
    send_queue.send(state(2))
    assert [msgspec.json.decode(frame)["state"]["t"] for frame in written] == [2]
    is_full = True
    send_queue.send(state(3))
    send_queue.send(state(4))
    is_full = False
    send_queue.send(Notice("behind the state that waits"))
    assert await waiting(send_queue) == [4, "notice"]


async def test_a_slow_reader_gets_no_state_at_once() -> None:
    written: list[bytes] = []
    send_queue = SendQueue(lambda frame: written.append(frame) is None)
    assert await waiting(send_queue) == []
    send_queue.beat(0.0)
    send_queue.beat(SLOW_AFTER_S + 0.1)
    send_queue.send(state(1))
    assert [msgspec.json.decode(frame)["type"] for frame in written] == ["ping"]
