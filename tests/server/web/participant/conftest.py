"""Fixtures of a participant's pages and sockets."""

from collections.abc import AsyncIterator

import pytest

from tests.support.served_sockets import Served, serving
from tests.support.small_site import site as site


@pytest.fixture
async def served() -> AsyncIterator[Served]:
    async with serving(Served()) as made:
        yield made
