"""A client that sends too much, too slowly or too often meets its own limit; all others continue."""

import asyncio
import socket
import time
from collections.abc import Iterator
from contextlib import AsyncExitStack, suppress
from typing import Any

import httpx
import pytest
from websockets.protocol import State

from server.web import forms, rate_limits
from server.web.participant.game_socket import MAX_OF_ONE
from tests.support.faults.group import SHORT_GAMES
from tests.support.faults.recording_client import RecordingClient
from tests.support.live_server import LiveServer


@pytest.fixture(scope="module")
def live(tmp_path_factory: pytest.TempPathFactory) -> Iterator[LiveServer]:
    with LiveServer(tmp_path_factory.mktemp("limits"), study=SHORT_GAMES) as running:
        yield running


async def enrolled(live: LiveServer) -> RecordingClient:
    client = RecordingClient(live.url)
    page = await client.ask("GET", "/s/short")
    await client.ask("POST", "/s/short/consent", page.form)
    return client


async def test_one_participant_who_asks_too_often_waits_and_another_does_not(
    live: LiveServer, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(rate_limits, "BURST", 10.0)
    monkeypatch.setattr(rate_limits, "PER_S", 0.1)
    eager, calm = await enrolled(live), await enrolled(live)
    statuses = [(await eager.http.get("/s/short/now")).status_code for _ in range(12)]
    assert statuses[:5] == [200] * 5
    assert statuses[-1] == 429
    refused = await eager.http.get("/s/short/now")
    assert refused.headers["retry-after"]
    assert "default-src 'none'" in refused.headers["content-security-policy"]
    assert (await calm.http.get("/s/short/now")).status_code == 200
    await eager.close()
    await calm.close()


def test_each_address_has_its_own_limit() -> None:
    counted = rate_limits.Rates()
    spent = [counted.spend("address 192.0.2.1", rate_limits.ADDRESS_PER_S, 50) for _ in range(60)]
    assert spent[:50] == [True] * 50
    assert False in spent
    assert counted.spend("address 192.0.2.2", rate_limits.ADDRESS_PER_S, 50)


def test_the_number_of_remembered_participants_is_bounded() -> None:
    counted = rate_limits.Rates()
    for number in range(rate_limits._MAX_REMEMBERED + 100):
        counted.spend(str(number), 1, 1)
    assert len(counted._buckets) == rate_limits._MAX_REMEMBERED


async def test_a_form_that_trickles_in_is_given_up(live: LiveServer, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(forms, "FORM_TIMEOUT_S", 0.3)
    with socket.create_connection(("127.0.0.1", live.port)) as slow:
        head = f"POST /s/short/now HTTP/1.1\r\nHost: 127.0.0.1:{live.port}\r\nContent-Length: 100\r\n\r\nstep="
        slow.sendall(head.encode())
        slow.settimeout(10)
        assert b" 408 " in slow.recv(4096).partition(b"\r\n")[0] + b" "


async def test_a_browser_that_leaves_while_it_sends_a_form_is_not_an_error_of_the_server(
    live: LiveServer, caplog: pytest.LogCaptureFixture, monkeypatch: pytest.MonkeyPatch
) -> None:
    read = asyncio.Event()
    kept, loop = forms.body_of, asyncio.get_running_loop()

    async def noticed(*arguments: Any) -> bytes:
        try:
            return await kept(*arguments)
        finally:
            loop.call_soon_threadsafe(read.set)

    monkeypatch.setattr(forms, "body_of", noticed)
    with socket.create_connection(("127.0.0.1", live.port)) as leaving:
        head = f"POST /s/short/now HTTP/1.1\r\nHost: 127.0.0.1:{live.port}\r\nContent-Length: 100\r\n\r\nstep="
        leaving.sendall(head.encode())
    await asyncio.wait_for(read.wait(), 10)
    client = await enrolled(live)  # by now the server has dealt with the other one
    await client.close()
    assert [record.getMessage() for record in caplog.records if record.levelname == "ERROR"] == []


async def test_a_form_that_is_sent_twenty_times_at_once_moves_on_once(live: LiveServer) -> None:
    once, often = await enrolled(live), await enrolled(live)
    page = await often.ask("GET", "/s/short/now")
    answers = await asyncio.gather(*(often.http.post("/s/short/now", data=page.form) for _ in range(20)))
    assert {answer.status_code for answer in answers} == {200}
    wanted = await once.submit(await once.ask("GET", "/s/short/now"))
    assert (await often.ask("GET", "/s/short/now")).form["step"] == wanted.form["step"] != page.form["step"]
    await once.close()
    await often.close()


async def test_a_participant_cannot_open_sockets_without_end(live: LiveServer) -> None:
    client = await enrolled(live)
    async with AsyncExitStack() as stack:
        held = [await stack.enter_async_context(client.game().connect()) for _ in range(MAX_OF_ONE + 3)]
        for one in held[:3]:
            await asyncio.wait_for(one.wait_closed(), 10)
            assert one.close_code == 1008
        await asyncio.sleep(0.1)
        assert all(one.state is State.OPEN for one in held[3:])
    await client.close()


def test_a_request_with_endless_headers_is_refused(live: LiveServer) -> None:
    began = time.monotonic()
    with socket.create_connection(("127.0.0.1", live.port)) as greedy:
        greedy.sendall(b"GET / HTTP/1.1\r\nHost: x\r\n")
        greedy.settimeout(10)
        with suppress(OSError):
            while time.monotonic() < began + 10:
                greedy.sendall(b"X-More: " + b"x" * 8000 + b"\r\n")
        assert time.monotonic() < began + 9, "nobody stopped it"
    assert httpx.get(live.url).status_code == 200
