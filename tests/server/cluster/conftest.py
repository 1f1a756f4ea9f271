"""Fixtures of several server processes."""

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from tests.support.live_server import LiveServer
from tests.support.postgres_pool import PostgresPool
from tests.support.redis_server import RedisServer
from tests.support.server_pair import PAIR_STUDY, Pair


@pytest.fixture
def own_redis() -> Iterator[RedisServer]:
    server = RedisServer()
    yield server
    server.remove()


@pytest.fixture
def pair(tmp_path: Path, postgres_pool: PostgresPool, own_redis: RedisServer) -> Iterator[Pair]:
    with postgres_pool.one() as address:
        shared: dict[str, Any] = {"database": address, "redis": own_redis.url}
        with (
            LiveServer(tmp_path, 2.0, PAIR_STUDY, **shared) as one,
            LiveServer(tmp_path, 2.0, PAIR_STUDY, **shared) as other,
        ):
            yield one, other
