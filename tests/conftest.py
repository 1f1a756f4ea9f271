"""For all tests: one thread per process, as several run in parallel; child processes inherit this."""

import atexit
import gc
import os
import shutil
import tempfile
from collections.abc import Iterator
from functools import cache
from pathlib import Path
from typing import Any
from zlib import crc32

import httpx._transports.default as http_transport
import pytest
from hypothesis import HealthCheck, settings

from tests.support.postgres_server import PostgresServer
from tests.support.redis_server import RedisServer

# A busy machine is slow to draw examples, which is not a fault of the code under test.
settings.register_profile("any_machine", deadline=None, suppress_health_check=[HealthCheck.too_slow])
settings.load_profile("any_machine")

for library in (
    "OMP_NUM_THREADS",
    "MKL_NUM_THREADS",
    "OPENBLAS_NUM_THREADS",
    "NUMBA_NUM_THREADS",
    "POLARS_MAX_THREADS",
):
    os.environ.setdefault(library, "1")

MEMORY = Path("/dev/shm")  # of Linux


def _keep_files_in_memory() -> None:
    """Have the temporary files of this run in memory where there is plenty: tests make and delete tens of thousands of
    small files, and some disks take milliseconds for each. Programs in it must run, and the server must not find its
    disk full. With `--basetemp`, the files of failed tests stay after the run."""
    if "TMPDIR" in os.environ or not os.access(MEMORY, os.W_OK):
        return
    found = os.statvfs(MEMORY)
    if found.f_bavail * found.f_frsize >= 8e9 and not found.f_flag & os.ST_NOEXEC:
        folder = tempfile.mkdtemp(prefix="kitchenmind-tests-", dir=MEMORY)
        Path(folder).chmod(0o711)  # PostgreSQL runs as another user
        atexit.register(shutil.rmtree, folder, ignore_errors=True)
        os.environ["TMPDIR"] = folder  # for child processes
        tempfile.tempdir = folder  # pytest has asked already


_keep_files_in_memory()

# Collecting makes half a million objects and no garbage; `pytest_collection_finish` turns collection on again.
gc.disable()

# httpx reads some hundred certificates for every client, 25 ms each time; the tests make thousands of clients.
_read_certificates = http_transport.create_ssl_context


@cache
def _certificates(_of_file: str | None, *given: Any, **named: Any) -> Any:
    return _read_certificates(*given, **named)


http_transport.create_ssl_context = lambda *given, **named: _certificates(
    os.environ.get("SSL_CERT_FILE"), *given, **named
)

# Files are distributed whole, in this order: slow ones first, so that no worker is left with it at the end, with
# browsers and others in turn, so that those of several files do not run at the same time; then the rest well mixed.
LONG_FIRST = (
    "test_game_browser_looks.py",
    "test_study_builder.py",
    "test_study_builder_parts.py",
    "test_runner.py",
    "test_report_edges.py",
    "test_game_browser_real.py",
    "test_tombstones.py",
    "test_several_workers.py",
    "test_board_stays_in_sight.py",
    "test_bots.py",
    "test_pages_are_accessible.py",
    "test_database.py",
    "test_pages_in_browser.py",
    "test_ppo.py",
    "test_admin_browser.py",
    "test_study_run.py",
    "test_one_episode.py",
    "test_report.py",
    "test_game_browser_keys.py",
    "test_episodes.py",
    "test_whole_study_in_browser.py",
    "test_wheel.py",
    "test_game_browser_line.py",
    "test_people_faults.py",
    "test_answers_in_browser.py",
    "test_cluster.py",
    "test_kitchen_editor.py",
    "test_any_request.py",
    "test_intentions_in_browser.py",
    "test_pairs.py",
    "test_game_browser_sizes.py",
    "test_bundle.py",
    "test_old_browsers.py",
    "test_predictor_training.py",
    "test_game_browser_delight.py",
    "test_importer.py",
    "test_game_browser_keyboards.py",
    "test_drafts.py",
    "test_marks_on_demand_in_browser.py",
    "test_verify.py",
    "test_game_browser_board.py",
    "test_introduction_in_browser.py",
    "test_bundled_agents.py",
    "test_behind_a_path.py",
    "test_process_faults.py",
    "test_third_language_in_browser.py",
    "test_client.py",
    "test_two_people_in_browsers.py",
)


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    def rank(item: pytest.Item) -> tuple[int, int]:
        name = item.path.name
        return LONG_FIRST.index(name) if name in LONG_FIRST else len(LONG_FIRST), crc32(name.encode())

    items.sort(key=rank)


def pytest_collection_finish() -> None:
    """Exclude the half a million objects of the imports, which are never freed, from garbage collection."""
    gc.freeze()
    gc.enable()


@pytest.fixture(scope="session")
def postgres() -> Iterator[PostgresServer]:
    """For all tests that do not stop it: each makes a separate database."""
    server = PostgresServer()
    yield server
    server.remove()


@pytest.fixture(scope="session")
def redis() -> Iterator[RedisServer]:
    server = RedisServer()
    yield server
    server.remove()


@pytest.fixture(scope="session")
def postgres_template(postgres: PostgresServer) -> str:
    """The name of a database that has the tables: copied in a moment, where migrating would take longer."""
    from server.store.migrate import migrate  # not before the number of threads is set

    name = postgres.new_database()
    migrate(postgres.url(name))
    return name
