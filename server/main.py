"""The one place where the parts are wired: settings in, a running application out."""

import asyncio
import gc
import logging
from collections.abc import AsyncIterator, Callable, Coroutine, Sequence
from contextlib import AsyncExitStack, asynccontextmanager
from datetime import UTC, datetime
from pathlib import Path
from typing import TYPE_CHECKING, Any

from fastapi import Depends, FastAPI
from fastapi.concurrency import run_in_threadpool
from fastapi.staticfiles import StaticFiles
from starlette.requests import HTTPConnection

from models.inference.launch import Launched
from models.inference.runner import ModelServer
from overcooked.compiled import only_our_kernels
from overcooked.constants import STAY
from server.background_tasks import ended
from server.cluster.dispatch import ClusterControl
from server.monitoring.alerts import Alert, Alerts, message_of
from server.monitoring.control import Control
from server.monitoring.dashboard import Dashboard
from server.monitoring.latency_history import LatencyHistory
from server.monitoring.live_games import LiveGames
from server.participation.episode_specs import layout_of
from server.participation.seating import ConnectedPlayer, Seating
from server.participation.served_studies import Studies
from server.participation.study_versions import StudyVersions
from server.participation.waiting_room import WaitingRoom
from server.play.clock import Clock
from server.play.games import Games
from server.play.recorder import EpisodeRecord, RecorderDown
from server.play.simulation import Simulation
from server.required_models import required_models
from server.settings import ROOT, Settings
from server.store import episodes, events
from server.store.database import Database, DatabaseDown
from server.store.engines import normal_url
from server.store.episodes import StoreRecorder
from server.store.migrate import migrate_shared, to_newest
from server.study.loader import StudyError, StudyFile, load_study
from server.study_check import missing_problems
from server.version import code_version
from server.web import health
from server.web.admin import actions, downloads, live_boards, replay_page, researcher_pages
from server.web.auth import CsrfProtection, token_of
from server.web.dependencies import Web, compile_templates, templates
from server.web.error_pages import install_error_pages
from server.web.guess_limits import Hashing
from server.web.health import Commits, figures_of
from server.web.participant import exits, game_socket, study_pages, watch_agents
from server.web.participant.game_socket import Sockets
from server.web.participant.watch_agents import Demonstrations
from server.web.rate_limits import NewPlaces, Rates, rate_limit
from server.web.request_boundary import Boundary
from server.web.security_headers import SecurityHeaders

if TYPE_CHECKING:
    from server.cluster.node import ClusterNode

log = logging.getLogger(__name__)
MAX_CLIENT_ERRORS = 100  # of one participant that are stored
_ROUTES = (
    study_pages,
    exits,
    game_socket,
    watch_agents,
    researcher_pages,
    live_boards,
    replay_page,
    actions,
    downloads,
    health,
)
_GARBAGE_THRESHOLDS = (50_000, 20, 20)  # a full collection costs milliseconds, and a game makes hardly any cycles


def create_app(settings: Settings, ahead: Launched | None = None) -> FastAPI:
    """The application; `wired` starts and stops its parts. `ahead`: a model worker's process, launched already."""
    limits = [Depends(rate_limit)]
    app = FastAPI(
        title="kitchenmind", docs_url=None, redoc_url=None, openapi_url=None, lifespan=wired, dependencies=limits
    )
    app.state.launched = ahead
    app.state.rates = Rates()
    app.state.settings = settings
    csrf = CsrfProtection(settings.signing_key(), settings.public_url)
    app.state.csrf = csrf
    app.add_middleware(SecurityHeaders, secure=csrf.secure)
    app.add_middleware(Boundary)
    app.mount("/static", StaticFiles(directory=ROOT / "static"), name="static")
    install_error_pages(app)
    app.state.hashing, app.state.commits = Hashing(), Commits()
    for module in _ROUTES:
        app.include_router(module.router)
    return app


@asynccontextmanager
async def wired(app: FastAPI) -> AsyncIterator[None]:
    """The application with all its parts running, as long as the context lasts.

    Raises StudyError, ModelsDown, DatabaseInUse, DatabaseDown, DatabaseTooNew.
    """
    settings: Settings = app.state.settings
    files = _served(settings)
    async with AsyncExitStack() as stack:
        several = settings.redis is not None
        models = _models(settings, files, app.state.launched)
        stack.push_async_callback(models.close)
        starting = asyncio.create_task(models.start())  # takes longest, in a process of its own
        stack.push_async_callback(ended, starting)  # nothing keeps running when the server does not start
        await run_in_threadpool(_warm, files)  # starlette's own way, which imports its parts at the first call
        if several:
            await asyncio.to_thread(migrate_shared, settings.database)
        database = Database(settings.database, shared=several, in_turn=several)
        stack.callback(database.close)
        if not several:
            await database.write(to_newest)
        studies = await Studies.opened(database, files)
        await starting
        app.state.models = models
        production = settings.mode == "production"
        places = NewPlaces(settings.new_per_address, counts_local=production)
        app.state.web = Web(database, studies, app.state.csrf, templates(), places, production)
        node = await _node(settings, files, stack) if several else None
        app.state.games = _games(settings, database, models, node)
        stack.push_async_callback(app.state.games.stop)
        app.state.versions = StudyVersions(settings, files, models, studies)
        await app.state.versions.load_earlier(database)
        app.state.sockets = _sockets(app, database, studies)
        app.state.demonstrations = Demonstrations(
            lambda recorder, load: Games(app.state.games.clock, models, recorder, load),
            studies,
            app.state.csrf.is_own_origin,
        )
        stack.push_async_callback(app.state.demonstrations.games.stop)
        stack.push_async_callback((await _researchers(app, settings, node)).stop)
        stack.push_async_callback(_alarm(app, settings))
        gc.freeze()
        gc.set_threshold(*_GARBAGE_THRESHOLDS)
        gc.enable()
        yield


def _models(settings: Settings, files: Sequence[StudyFile], ahead: Launched | None) -> ModelServer:
    required = required_models(files)
    models = ModelServer(
        required.agents, required.predictors, settings.model_workers, grids=required.grids, ahead=ahead
    )
    models.paths = required.paths
    return models


def _served(settings: Settings) -> list[StudyFile]:
    """The studies that can be played. Raises StudyError for a broken file, and where an agent or predictor is missing;
    of several studies in local mode only those without their models are left out."""
    served, reasons = [], []
    for path in settings.studies:
        file = load_study(path, settings.models_folder)
        missing = [file.describe(problem) for problem in missing_problems(file, required_models([file]))]
        reasons += missing
        if not missing:
            served.append(file)
    if not served or (reasons and settings.mode == "production"):
        raise StudyError(reasons)
    for reason in reasons:
        log.warning("a study is not served: %s", reason)
    return served


async def _node(settings: Settings, files: list[StudyFile], stack: AsyncExitStack) -> "ClusterNode":
    """This process among several. Raises StudyError, ClusterDown, DatabaseDown."""
    from server.cluster.node import ClusterNode, refuse_pairs
    from server.cluster.registry import Cluster
    from server.store.fences import FencedRecorder

    assert settings.redis is not None  # noqa: S101 the caller looked
    refuse_pairs(files)
    of_games = Database(settings.database, readers=2, shared=True)  # a tick never waits its turn behind a page
    stack.callback(of_games.close)
    cluster = Cluster(settings.redis.get_secret_value(), settings.database)
    stack.push_async_callback(cluster.close)
    await cluster.reach()
    return ClusterNode(FencedRecorder(of_games), cluster)


def _games(settings: Settings, database: Database, models: ModelServer, node: "ClusterNode | None") -> Games:
    clock = Clock(settings.speed, settings.patience_s)
    if node is not None:
        return Games(clock, models, node.recorder, node.load, owners=node)

    async def load(episode: str) -> EpisodeRecord | None:
        try:
            return await database.read(episodes.load, episode)
        except DatabaseDown as down:
            raise RecorderDown(str(down)) from down

    return Games(clock, models, StoreRecorder(database), load)


def _sockets(app: FastAPI, database: Database, studies: Studies) -> Sockets:
    async def report(participant: str, text: str) -> None:
        event = events.Event("trouble", datetime.now(UTC), participant, detail={"text": text})
        try:
            await database.write(events.add_at_most, event, MAX_CLIENT_ERRORS)
        except DatabaseDown:
            log.warning("a problem in a browser could not be stored: %r", text)

    seats = Seating(database, studies, app.state.versions.fingerprint, code_version())

    async def find(connection: HTTPConnection, study: str) -> ConnectedPlayer | None:
        return await seats.find(token_of(connection), study)

    room = WaitingRoom(app.state.games.clock, seats.seat_two, seats.seat_alone)
    return Sockets(app.state.games, find, app.state.csrf.is_own_origin, report, room)


async def _researchers(app: FastAPI, settings: Settings, node: "ClusterNode | None") -> Control:
    """What the researchers' pages look through and reach in with."""
    web: Web = app.state.web
    peers = None if node is None else node.cluster
    app.state.live = LiveGames(web, app.state.games, app.state.sockets, peers)
    url = normal_url(settings.database)
    file = Path(str(url.database)) if url.get_backend_name() == "sqlite" else None
    app.state.figures = Dashboard(app.state.live, file)
    control = Control(app.state.games, web.database, web.studies)
    await control.begin()
    app.state.control = ClusterControl(control, peers)
    if node is not None:
        node.show(app.state.live, control, lambda: figures_of(app.state))
    return control


def _alarm(app: FastAPI, settings: Settings) -> Callable[[], Coroutine[Any, Any, None]]:
    """Looks for alerts, posts them where the settings say, and samples the course; returns what stops it."""
    hook = None
    if settings.alert_webhook:
        from server.monitoring.webhook import Webhook

        hook = Webhook(settings.alert_webhook.get_secret_value())

    def tell(alert: Alert, over: bool) -> None:
        log.log(logging.INFO if alert.study else logging.WARNING, "alert%s: %s", " over" if over else "", alert.text)
        if hook is not None:
            hook.send(message_of(alert, over, settings.public_url))

    app.state.alerts = Alerts(app.state.live, app.state.figures.file, tell, app.state.versions)
    app.state.latency_history = LatencyHistory(app.state.live)
    running = (app.state.alerts, app.state.latency_history, app.state.versions, hook)
    tasks = [asyncio.create_task(work.run()) for work in running if work is not None]

    async def stop() -> None:
        await ended(*tasks)

    return stop


def _warm(files: Sequence[StudyFile]) -> None:
    """Nothing is compiled once pages can be opened: the first game would stand still for it."""
    compile_templates()
    with only_our_kernels():
        for file in files:
            simulation = Simulation(layout_of(file.study.layouts[0]), horizon=1)
            simulation.step((STAY, STAY))
            simulation.history(0)(1)
