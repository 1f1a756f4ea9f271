"""A participant disappears from a game, and an alert is posted to the researcher's chat."""

import asyncio
import json
import threading
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path

import pytest

from server.bots.participant import Bot
from tests.support.live_server import LiveServer


async def disappear(url: str) -> None:
    """Begin a game and disappear."""
    bot = Bot(url, "short", 1)
    page = await bot.consent()
    while not page.is_game:
        page = await bot.submit(page)
    playing = asyncio.create_task(bot.game().play())
    while len(bot.journal.states) < 10:
        await asyncio.sleep(0.02)
    playing.cancel()
    await asyncio.gather(playing, return_exceptions=True)
    await bot.close()


def test_a_disconnected_participant_is_reported_to_the_webhook(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    heard, arrived = [], threading.Event()

    class AlertHandler(BaseHTTPRequestHandler):
        def do_POST(self) -> None:
            message = json.loads(self.rfile.read(int(self.headers["Content-Length"])))
            if "late" not in message["text"]:  # a machine that is busy with other tests may say so too
                heard.append(message)
                arrived.set()
            self.send_response(204)
            self.end_headers()

        def log_message(self, *_: object) -> None: ...

    chat = ThreadingHTTPServer(("127.0.0.1", 0), AlertHandler)
    threading.Thread(target=chat.serve_forever, daemon=True).start()
    monkeypatch.setenv("KITCHENMIND_ALERT_WEBHOOK", f"http://127.0.0.1:{chat.server_address[1]}/hook")
    with LiveServer(tmp_path, speed=3.0) as server:
        asyncio.run(disappear(server.url))
        assert arrived.wait(60), "the alert was not posted within a minute"
    chat.shutdown()
    chat.server_close()
    assert heard[0]["text"].startswith("kitchenmind: short: B-001 is away (disconnected) for ")
    assert heard[0]["state"] == "open"
