"""Post alerts to an address from the settings, e.g. of a chat, in the background. The address is never logged. Delivery
is tried a few times, then dropped: the dashboard and the database have the alert anyway.
"""

import asyncio
import logging
from collections import deque
from collections.abc import Mapping, Sequence
from typing import Any, Final

import httpx

log = logging.getLogger(__name__)
PAUSES_S: Final = (1.0, 5.0, 30.0)  # before each further try
TIMEOUT_S: Final = 5.0
MAX_WAITING: Final = 100
_AGAIN = frozenset({408, 425, 429})


class Webhook:
    """`send` returns at once; `run` delivers in order until it is cancelled."""

    def __init__(self, address: str, pauses_s: Sequence[float] = PAUSES_S) -> None:
        self._address, self._pauses_s = address, tuple(pauses_s)
        self._waiting: deque[Mapping[str, Any]] = deque(maxlen=MAX_WAITING)  # the oldest goes first
        self._fresh = asyncio.Event()
        logging.getLogger("httpx").setLevel(logging.WARNING)  # it would log the address, which is a secret

    def send(self, message: Mapping[str, Any]) -> None:
        """Deliver the message as JSON some time later."""
        self._waiting.append(message)
        self._fresh.set()

    async def run(self) -> None:
        async with httpx.AsyncClient(timeout=TIMEOUT_S, follow_redirects=False) as client:
            while True:
                await self._fresh.wait()
                self._fresh.clear()
                while self._waiting:
                    await self._deliver(client, self._waiting.popleft())

    async def _deliver(self, client: httpx.AsyncClient, message: Mapping[str, Any]) -> None:
        reason = ""
        for pause_s in (0.0, *self._pauses_s):
            await asyncio.sleep(pause_s)
            try:
                status = (await client.post(self._address, json=message)).status_code
            except Exception as error:  # noqa: BLE001 - also InvalidURL, OverflowError: later alerts are still tried
                reason = type(error).__name__
                continue
            if status < 300:
                return
            reason = f"it answered {status}"
            if status < 500 and status not in _AGAIN:
                break
        log.warning("an alert could not be delivered to the webhook: %s", reason)
