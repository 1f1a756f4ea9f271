"""The address that a request comes from, as limits count it."""

import ipaddress
from typing import Final

from starlette.requests import HTTPConnection

HERE: Final = frozenset({"127.0.0.1", "::1"})  # simulated participants and the tests come from there
_OF_ONE_SITE: Final = 64  # bits of an IPv6 address that a provider gives to one customer; the rest is theirs to change


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
