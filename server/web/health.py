"""Health checks and Prometheus metrics: whether the server is alive, whether it can play, and how much it does."""

import asyncio
import hmac
import os
import resource
import time
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Final

from fastapi import APIRouter, HTTPException, Request, Response
from fastapi.responses import JSONResponse
from prometheus_client.exposition import CONTENT_TYPE_PLAIN_0_0_4, generate_latest
from prometheus_client.metrics_core import CounterMetricFamily, GaugeMetricFamily, Metric

from server.monitoring.live_games import LiveGames
from server.monitoring.peers import Process
from server.settings import Settings
from server.store.database import Database, DatabaseDown
from server.web.services import ServicesDep

if TYPE_CHECKING:
    from models.inference.runner import ModelServer

router = APIRouter()
READY_TIMEOUT_S: Final = 3.0  # less than the 4 s that the health check of docker-compose.yml waits
_PROVED_FOR_S: Final = 1.0  # at most one test commit a second, however many requests there are
_MEMORY: Final = Path("/proc/self/statm")
_FILES: Final = Path("/proc/self/fd")
# Metric (without "kitchenmind_") -> its Prometheus type and its HELP text.
METRICS: Final[Mapping[str, tuple[str, str]]] = {
    "games": ("gauge", "Games that were taken up, running or not."),
    "moving": ("gauge", "Games that count down or run."),
    "sockets": ("gauge", "Open game sockets."),
    "ticks_total": ("counter", "Timesteps that were made."),
    "partner_waits_total": ("counter", "Timesteps in which the partner had to wait for its models."),
    "tick_lateness_seconds_p50": ("gauge", "How late the timesteps of the last minute began: the median."),
    "tick_lateness_seconds_p99": ("gauge", "How late the timesteps of the last minute began: the 99th percentile."),
    "model_seconds_p50": ("gauge", "Time of a worker for one batch of questions: the median."),
    "model_seconds_p99": ("gauge", "Time of a worker for one batch of questions: the 99th percentile."),
    "model_restarts_total": ("counter", "Model workers that were replaced."),
    "model_faults_total": ("counter", "Questions that a model broke on."),
    "resident_memory_bytes": ("gauge", "Memory of the server process."),
    "cpu_seconds_total": ("counter", "CPU time of the server process."),
    "open_files": ("gauge", "Open files and sockets of the server process."),
}


def metrics_of(live: LiveGames, model_server: "ModelServer") -> dict[str, float]:
    """Return the METRICS of this process."""
    loop, models = live.games.loop, model_server.statistics()
    late_ms = loop.lateness.last() or [0.0]
    used = resource.getrusage(resource.RUSAGE_SELF)
    return {
        "games": len(live.games),
        "moving": loop.moving,
        "sockets": len(live.sockets),
        "ticks_total": loop.made,
        "partner_waits_total": loop.waits,
        "tick_lateness_seconds_p50": late_ms[len(late_ms) // 2] / 1000,
        "tick_lateness_seconds_p99": late_ms[int(0.99 * len(late_ms))] / 1000,
        "model_seconds_p50": models.model_ms[0] / 1000,
        "model_seconds_p99": models.model_ms[1] / 1000,
        "model_restarts_total": models.restarts,
        "model_faults_total": sum(models.faults.values()),
        "cpu_seconds_total": used.ru_utime + used.ru_stime,
        **_memory_and_files(),
    }


def _memory_and_files() -> dict[str, float]:
    """Return the memory and open files of this process; empty where the system does not provide them."""
    if not (_MEMORY.exists() and _FILES.exists()):
        return {}
    pages = int(_MEMORY.read_text().split()[1])
    return {
        "resident_memory_bytes": pages * os.sysconf("SC_PAGE_SIZE"),
        "open_files": sum(1 for _ in _FILES.iterdir()),
    }


class Commits:
    """Whether the database commits. A database that can be read is not enough: somebody may hold its write lock."""

    def __init__(self) -> None:
        self._proof: asyncio.Task[bool] | None = None
        self._made_at = -_PROVED_FOR_S

    async def succeed(self, database: Database) -> bool:
        """Return whether a test commit succeeds within READY_TIMEOUT_S; everybody who asks shares it."""
        over = self._proof is None or (self._proof.done() and time.monotonic() - self._made_at >= _PROVED_FOR_S)
        if self._proof is None or over:
            self._proof = asyncio.create_task(self._prove(database))
        try:
            async with asyncio.timeout(READY_TIMEOUT_S):
                return await asyncio.shield(self._proof)
        except TimeoutError:
            return False

    async def _prove(self, database: Database) -> bool:
        try:
            await database.probe()
        except DatabaseDown:
            return False
        finally:
            self._made_at = time.monotonic()
        return True


@router.get("/health/live")
async def live() -> dict[str, str]:
    """Return that the process answers, and that it is of this project (`kitchenmind doctor` asks)."""
    return {"status": "alive", "server": "kitchenmind"}


@router.get("/health/ready")
async def ready(services: ServicesDep) -> Response:
    """Return whether games can be played: the database commits and the models answer. 503 with what is missing."""
    missing = []
    if not services.models.ready:
        missing.append("models")
    if not await services.commits.succeed(services.web.database):
        missing.append("database")
    if services.games.stopping:
        missing.append("stopping")
    return JSONResponse({"ready": not missing, "missing": missing}, 503 if missing else 200)


@router.get("/metrics")
async def metrics(request: Request, services: ServicesDep) -> Response:
    """Return the metrics of all server processes: with KITCHENMIND_METRICS_TOKEN only for requests that have it,
    otherwise only in local mode."""
    _let_in(request, services.settings)
    peers = services.live.peers
    own = metrics_of(services.live, services.models)
    processes = [Process(peers.name, own), *await peers.processes()]
    return Response(generate_latest(ProcessMetrics(processes)), headers={"Content-Type": CONTENT_TYPE_PLAIN_0_0_4})


def _let_in(request: Request, settings: Settings) -> None:
    if settings.metrics_token is not None:
        given = request.headers.get("authorization", "").encode()
        if not hmac.compare_digest(given, b"Bearer " + settings.metrics_token.get_secret_value().encode()):
            raise HTTPException(
                401,
                "The metrics need a token. Send the header `Authorization: Bearer` with KITCHENMIND_METRICS_TOKEN.",
                {"WWW-Authenticate": "Bearer"},
            )
    elif settings.mode == "production":
        raise HTTPException(404, "The metrics are off. Set KITCHENMIND_METRICS_TOKEN to turn them on.")


@dataclass(frozen=True)
class ProcessMetrics:
    """Collect the METRICS of all server processes, labelled by process, for one answer."""

    processes: Sequence[Process]

    def collect(self) -> Iterator[Metric]:
        for name, (kind, meaning) in METRICS.items():
            family = (CounterMetricFamily if kind == "counter" else GaugeMetricFamily)(
                f"kitchenmind_{name}", meaning, labels=["process"]
            )
            for process in self.processes:
                if name in process.figures:
                    family.add_metric([process.name], process.figures[name])
            yield family
