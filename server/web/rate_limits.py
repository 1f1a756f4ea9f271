"""Limits on the number of requests of one participant and of one address.

Counted by participant first: a household, a laboratory or a university shares an address. Requests from this machine
are not counted by address, as simulated participants and the tests connect from there.

Not the library `limits`: it counts in windows, without a token bucket that allows a burst and then a steady rate, which
sockets use too; and it cannot count new participants in the transaction that enrols them.
"""

import hashlib
import hmac
import time
from collections import OrderedDict
from typing import Final

from fastapi import HTTPException
from starlette.requests import HTTPConnection

from server.play.token_bucket import TokenBucket
from server.store.enrolment_limits import EnrolmentLimit
from server.web.auth import token_of
from server.web.client_address import HERE, address_of, site_of
from server.web.services import services_of

PER_S: Final = 10.0  # of one participant
BURST: Final = 100.0
ADDRESS_PER_S: Final = 100.0  # of all behind one address
ADDRESS_BURST: Final = 2000.0
_MAX_REMEMBERED: Final = 10_000
_LARGE_SITE: Final = 4  # addresses' worth of new participants that a whole IPv6 site may bring


class Rates:
    """The token buckets of recent clients."""

    def __init__(self) -> None:
        self._buckets: OrderedDict[str, TokenBucket] = OrderedDict()

    def spend(self, key: str, per_s: float, burst: float) -> bool:
        """Take one token; False if there is none left."""
        now = time.monotonic()
        bucket = self._buckets.setdefault(key, TokenBucket(now, 1.0, per_s, burst))
        self._buckets.move_to_end(key)
        if len(self._buckets) > _MAX_REMEMBERED:
            self._buckets.popitem(last=False)
        return bucket.spend(now)


class EnrolmentLimits:
    """How many new participants an address may bring. `an_hour` 0: any number.

    `secret`: the database knows networks by their hashes only. `counts_local`: whether this machine counts as an
    address; it does where other people's requests come through it.
    """

    def __init__(self, an_hour: int = 0, secret: bytes = b"", counts_local: bool = False) -> None:
        self.an_hour = an_hour
        self._secret, self._counts_local = secret, counts_local

    def limits_of(self, address: str) -> list[EnrolmentLimit]:
        """Return the limits that a new participant from this address uses; empty if there is no limit."""
        if not self.an_hour or (address in HERE and not self._counts_local):
            return []
        limits, site = [EnrolmentLimit(self._hashed(address), self.an_hour)], site_of(address)
        if site is not None:
            limits.append(EnrolmentLimit(self._hashed(site), _LARGE_SITE * self.an_hour))
        return limits

    def _hashed(self, network: str) -> str:
        return hmac.new(self._secret, f"network\n{network}".encode(), hashlib.sha256).hexdigest()


async def rate_limit(connection: HTTPConnection) -> None:
    """Answer 429 if an address sends too many requests, on every route. Sockets have token buckets of their own."""
    if connection.scope["type"] != "http":
        return
    rates = services_of(connection).rates
    address, token = address_of(connection), token_of(connection)
    allowed = address in HERE or rates.spend(f"address {address}", ADDRESS_PER_S, ADDRESS_BURST)
    if token is not None:
        who = hashlib.sha256(token.encode()).hexdigest()
        allowed = rates.spend(who, PER_S, BURST) and allowed
    if not allowed:
        raise HTTPException(429, "Too many requests. Wait a few seconds and try again.", {"Retry-After": "5"})
