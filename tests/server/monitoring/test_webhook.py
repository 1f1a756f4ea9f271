"""Delivery of alerts to a real HTTP server that sometimes fails."""

import asyncio
import json
import logging
import socket
import threading
import time
from collections.abc import Iterator
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from typing import Any

import pytest

from server.background_tasks import ended
from server.monitoring.webhook import MAX_WAITING, Webhook
from server.settings import Settings

QUICK = (0.01, 0.01, 0.01)


class WebhookHandler:
    """Answers with the statuses in `answers`, then with 200; keeps what was posted."""

    def __init__(self) -> None:
        self.answers: list[int] = []
        self.delay_s = 0.0
        self.posted: list[Any] = []
        chat = self

        class Handler(BaseHTTPRequestHandler):
            def do_POST(self) -> None:
                body = self.rfile.read(int(self.headers["Content-Length"]))
                time.sleep(chat.delay_s)
                chat.posted.append((self.path, self.headers["Content-Type"], json.loads(body)))
                self.send_response(chat.answers.pop(0) if chat.answers else 200)
                self.send_header("Content-Length", "0")
                self.end_headers()

            def log_message(self, *_: object) -> None: ...

        self.server = ThreadingHTTPServer(("127.0.0.1", 0), Handler)
        self.address = f"http://127.0.0.1:{self.server.server_address[1]}/hooks/not-for-everybody"
        threading.Thread(target=self.server.serve_forever, daemon=True).start()


@pytest.fixture
def chat() -> Iterator[WebhookHandler]:
    running = WebhookHandler()
    yield running
    running.server.shutdown()
    running.server.server_close()


async def delivered(chat: WebhookHandler, messages: list[dict[str, str]], wanted: int, address: str = "") -> None:
    """Send, and wait until so many posts have arrived."""
    hook = Webhook(address or chat.address, QUICK)
    task = asyncio.create_task(hook.run())
    for message in messages:
        hook.send(message)
    async with asyncio.timeout(30):
        while len(chat.posted) < wanted:
            await asyncio.sleep(0.01)
    await asyncio.sleep(0.05)
    task.cancel()
    await asyncio.gather(task, return_exceptions=True)


def test_alerts_arrive_as_json_in_order(chat: WebhookHandler) -> None:
    asyncio.run(delivered(chat, [{"text": "one"}, {"text": "two"}], 2))
    assert chat.posted == [
        ("/hooks/not-for-everybody", "application/json", {"text": "one"}),
        ("/hooks/not-for-everybody", "application/json", {"text": "two"}),
    ]


def test_an_alert_is_retried_while_the_webhook_fails(chat: WebhookHandler) -> None:
    chat.answers = [503, 429]
    asyncio.run(delivered(chat, [{"text": "again"}], 3))
    assert [body for _, _, body in chat.posted] == [{"text": "again"}] * 3


def test_an_alert_that_is_refused_is_not_tried_again(chat: WebhookHandler) -> None:
    chat.answers = [404]
    asyncio.run(delivered(chat, [{"text": "wrong address"}, {"text": "next"}], 2))
    assert [body["text"] for _, _, body in chat.posted] == ["wrong address", "next"]


def test_sending_an_alert_never_waits_and_the_queue_is_bounded(chat: WebhookHandler) -> None:
    async def flood() -> None:
        hook = Webhook(chat.address, QUICK)
        task = asyncio.create_task(hook.run())
        hook.send({"text": "first"})
        await asyncio.sleep(0.1)  # it hangs at the chat
        for number in range(3 * MAX_WAITING):
            hook.send({"text": str(number)})
        assert len(hook._waiting) == MAX_WAITING
        assert hook._waiting[-1] == {"text": str(3 * MAX_WAITING - 1)}, "the newest are kept"
        task.cancel()
        await asyncio.gather(task, return_exceptions=True)

    chat.delay_s = 1.0
    asyncio.run(flood())


def test_the_address_is_in_no_log(chat: WebhookHandler, caplog: pytest.LogCaptureFixture) -> None:
    with socket.create_server(("127.0.0.1", 0)) as closed:
        port = closed.getsockname()[1]
    chat.answers = [500] * 4

    async def fail() -> None:
        await delivered(chat, [{"text": "x"}], 4)
        hook = Webhook(f"http://127.0.0.1:{port}/hooks/not-for-everybody", QUICK)
        task = asyncio.create_task(hook.run())
        hook.send({"text": "nobody listens"})
        async with asyncio.timeout(30):
            while len(caplog.records) < 2:
                await asyncio.sleep(0.01)
        task.cancel()
        await asyncio.gather(task, return_exceptions=True)

    with caplog.at_level(logging.INFO):
        asyncio.run(fail())
    assert "it answered 500" in caplog.text
    assert "ConnectError" in caplog.text
    assert "hooks" not in caplog.text
    assert str(port) not in caplog.text
    assert "hooks" not in repr(Settings(alert_webhook=chat.address))


def test_a_webhook_is_an_address() -> None:
    with pytest.raises(ValueError, match="KITCHENMIND_ALERT_WEBHOOK must be an address"):
        Settings(alert_webhook="chat.example.org/hooks")


@pytest.mark.parametrize("address", ["https://ä..example/hooks", "https://127.0.0.1:99999/hooks"])
def test_an_address_that_cannot_be_used_is_logged_for_every_alert(
    address: str, caplog: pytest.LogCaptureFixture
) -> None:
    async def fail() -> None:
        hook = Webhook(address, ())
        task = asyncio.create_task(hook.run())
        for number in (1, 2):
            hook.send({"text": "nobody reads this"})
            async with asyncio.timeout(30):
                while len(caplog.records) < number and not task.done():
                    await asyncio.sleep(0.01)
        await ended(task)

    asyncio.run(fail())
    assert [record.message.partition(":")[0] for record in caplog.records] == [
        "an alert could not be delivered to the webhook"
    ] * 2
    assert "hooks" not in caplog.text
