"""How many pages one participant, and one address, may ask for. Knows neither study nor database.

Counted by participant first: a household, a laboratory or a university shares an address. Requests from this machine
are not counted by address, as simulated participants and the tests come from there.

Not the library `limits`: it counts in windows, without a token bucket that allows a burst and then a steady rate, and
cannot give back a place that was taken before anything was awaited. Sockets use the same bucket.
"""

import hashlib
import time
from collections import OrderedDict
from dataclasses import dataclass
from typing import Final

from fastapi import HTTPException
from starlette.requests import HTTPConnection

from server.play.token_bucket import TokenBucket
from server.web.auth import token_of
from server.web.client_address import HERE, address_of, site_of
from server.web.services import services_of

PER_S: Final = 10.0  # of one participant
BURST: Final = 100.0
ADDRESS_PER_S: Final = 100.0  # of all behind one address
ADDRESS_BURST: Final = 2000.0
_MOST_REMEMBERED: Final = 10_000
_HOUR_S: Final = 3600.0
_LARGE_SITE: Final = 4  # addresses' worth of new participants that a whole IPv6 site may bring


class Rates:
    """The budgets of everybody who asked lately."""

    def __init__(self) -> None:
        self._buckets: OrderedDict[str, TokenBucket] = OrderedDict()

    def spend(self, key: str, per_s: float, burst: float) -> bool:
        """Take one request's worth; False if there is none left."""
        now = time.monotonic()
        bucket = self._buckets.setdefault(key, TokenBucket(now, 1.0, per_s, burst))
        self._buckets.move_to_end(key)
        if len(self._buckets) > _MOST_REMEMBERED:
            self._buckets.popitem(last=False)
        return bucket.spend(now)


@dataclass
class TurnedAway:
    """How many were turned away in a study, and when the last one was, in seconds of the monotonic clock."""

    people: int = 0
    last_s: float = 0.0


@dataclass
class _Reservation:
    """A place that was taken from a budget; `waiting`: how many requests with the same page are on their way."""

    buckets: list[TokenBucket]
    waiting: int = 1
    used: bool = False


class NewPlaces:
    """How many new participants an address may bring. `an_hour` 0: any number.

    `counts_local`: whether this machine counts as an address; it does where other people's requests come through it.
    """

    def __init__(self, an_hour: int = 0, counts_local: bool = False) -> None:
        self.an_hour = an_hour
        self._counts_local = counts_local
        self._buckets: OrderedDict[str, TokenBucket] = OrderedDict()
        self._reserved: dict[str, _Reservation] = {}  # by page, while its participant is being stored
        self._turned_away: dict[str, TurnedAway] = {}

    def reserve(self, address: str, study: str, page: str) -> bool:
        """Take one of the address's places before anything is awaited; False if none is left. `settle` ends it.

        `page`: the consent page that was sent; sent twice at once, it takes one place.
        """
        if not self.an_hour or (address in HERE and not self._counts_local):
            return True
        if page in self._reserved:
            self._reserved[page].waiting += 1
            return True
        now = time.monotonic()
        buckets, site = [self._bucket(address, self.an_hour, now)], site_of(address)
        if site is not None:
            buckets.append(self._bucket(site, _LARGE_SITE * self.an_hour, now))
        spent = [bucket for bucket in buckets if bucket.spend(now)]
        if len(spent) == len(buckets):
            self._reserved[page] = _Reservation(buckets)
            return True
        for bucket in spent:
            bucket.refund()
        turned = self._turned_away.setdefault(study, TurnedAway())
        turned.people, turned.last_s = turned.people + 1, now
        return False

    def _bucket(self, network: str, an_hour: int, now: float) -> TokenBucket:
        bucket = self._buckets.setdefault(network, TokenBucket(now, 1.0, an_hour / _HOUR_S, float(an_hour)))
        self._buckets.move_to_end(network)
        if len(self._buckets) > _MOST_REMEMBERED:
            self._buckets.popitem(last=False)
        return bucket

    def settle(self, page: str, used: bool) -> None:
        """Give the reserved place back unless somebody new came of it."""
        reservation = self._reserved.get(page)
        if reservation is None:
            return
        reservation.waiting -= 1
        reservation.used |= used
        if reservation.waiting == 0:
            del self._reserved[page]
            if not reservation.used:
                for bucket in reservation.buckets:
                    bucket.refund()

    def turned_away(self, study: str) -> int:
        """Return how many were turned away lately; 0 once an hour has passed without one."""
        turned = self._turned_away.get(study)
        if turned is None or time.monotonic() - turned.last_s > _HOUR_S:
            self._turned_away.pop(study, None)
            return 0
        return turned.people


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
        raise HTTPException(429, "too many requests: wait a little", {"Retry-After": "5"})
