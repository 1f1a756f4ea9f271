"""How many pages one participant, and one address, may ask for. Knows neither study nor database.

Counted by participant first: a household, a laboratory or a university shares an address. Requests from this machine
are not counted by address, as simulated participants and the tests come from there.
"""

import hashlib
import time
from collections import OrderedDict
from typing import Final

from fastapi import HTTPException
from starlette.requests import HTTPConnection

from server.play.budget import Budget
from server.web.addresses import HERE, address_of
from server.web.auth import token_of

PER_S: Final = 10.0  # of one participant
BURST: Final = 100.0
ADDRESS_PER_S: Final = 100.0  # of all behind one address
ADDRESS_BURST: Final = 2000.0
_MOST_REMEMBERED: Final = 10_000


class Rates:
    """The budgets of everybody who asked lately."""

    def __init__(self) -> None:
        self._budgets: OrderedDict[str, Budget] = OrderedDict()

    def spend(self, key: str, per_s: float, burst: float) -> bool:
        """Takes one request's worth; False if there is none left."""
        now = time.monotonic()
        budget = self._budgets.setdefault(key, Budget(now, 1.0, per_s, burst))
        self._budgets.move_to_end(key)
        if len(self._budgets) > _MOST_REMEMBERED:
            self._budgets.popitem(last=False)
        return budget.spend(now)


async def keep_to_the_rate(connection: HTTPConnection) -> None:
    """For every route. Answers 429 to whoever asks too often; sockets have budgets of their own."""
    if connection.scope["type"] != "http":
        return
    rates: Rates = connection.app.state.rates
    address, token = address_of(connection), token_of(connection)
    allowed = address in HERE or rates.spend(f"address {address}", ADDRESS_PER_S, ADDRESS_BURST)
    if token is not None:
        who = hashlib.sha256(token.encode()).hexdigest()
        allowed = rates.spend(who, PER_S, BURST) and allowed
    if not allowed:
        raise HTTPException(429, "too many requests: wait a little", {"Retry-After": "5"})
