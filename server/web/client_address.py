"""The client's address of a request, for rate limits."""

import ipaddress
from typing import Final

from starlette.requests import HTTPConnection

HERE: Final = frozenset({"127.0.0.1", "::1"})  # simulated participants and the tests connect from there
_OF_ONE_SITE: Final = 64  # bits of an IPv6 address that a provider gives to one customer; the rest is theirs to change
_OF_A_LARGE_SITE: Final = 48  # what a provider gives at most: 65,536 such networks for one customer


def address_of(connection: HTTPConnection) -> str:
    """Return the client's address; of an IPv6 address the network, as one customer has all of it.

    Behind a proxy it is what the proxy says, if the proxy is one of KITCHENMIND_TRUSTED_PROXIES.
    """
    host = connection.client.host if connection.client else "?"
    try:
        address = ipaddress.ip_address(host)
    except ValueError:
        return host[:100]
    if isinstance(address, ipaddress.IPv4Address):
        return str(address)
    if address.ipv4_mapped is not None:
        return str(address.ipv4_mapped)
    if address.is_loopback:
        return str(address)
    return str(ipaddress.IPv6Network((int(address), _OF_ONE_SITE), strict=False))


def site_of(address: str) -> str | None:
    """Return the largest IPv6 network that one customer may have around what `address_of` gave, None for IPv4."""
    try:
        network = ipaddress.IPv6Network(address)
    except ValueError:
        return None
    return str(network.supernet(new_prefix=_OF_A_LARGE_SITE)) if network.prefixlen == _OF_ONE_SITE else None
