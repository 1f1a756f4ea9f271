"""Connect all parts of the server: settings in, a running application out."""

import asyncio
import gc
import logging
from collections.abc import AsyncIterator, Callable, Sequence
from contextlib import AsyncExitStack, asynccontextmanager
from datetime import UTC, datetime
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

from fastapi import Depends, FastAPI
from fastapi.concurrency import run_in_threadpool
from fastapi.staticfiles import StaticFiles
from starlette.requests import HTTPConnection

from kitchenmind.command_line import GARBAGE_THRESHOLDS
from models.inference.launch import Launched
from models.inference.runner import ModelServer
from server import warm_up
from server.background_tasks import ended
from server.cluster.command_dispatch import ClusterControl
from server.monitoring.alerts import Alert, Alerts, message_of
from server.monitoring.control import Control
from server.monitoring.dashboard import Dashboard
from server.monitoring.data_quality import load_rules
from server.monitoring.latency_history import LatencyHistory
from server.monitoring.live_games import LiveGames
from server.monitoring.peers import Process
from server.monitoring.rehearsals import Rehearsals
from server.monitoring.report_making import StudyReports
from server.monitoring.temporary_folders import remove_abandoned
from server.participation.game_seats import ConnectedPlayer, Seating
from server.participation.kitchen_files import write_kitchens
from server.participation.language_folder import LanguageFolder
from server.participation.preview_models import PreviewModels
from server.participation.served_studies import Studies
from server.participation.study_versions import StudyVersions
from server.participation.waiting_room import WaitingRoom
from server.play.clock import Clock
from server.play.games import Games
from server.play.recorder import EpisodeRecord, RecorderDown
from server.playable_studies import playable_studies
from server.required_models import required_models
from server.settings import ROOT, Settings
from server.store import episodes, events, kitchens
from server.store.database import Database, DatabaseDown
from server.store.engines import normal_url
from server.store.migrate import migrate_shared, to_newest
from server.store.store_recorder import StoreRecorder
from server.study.loader import StudyFile
from server.version import code_version
from server.web import health, protocol_document
from server.web.admin import routes as researcher_routes
from server.web.admin.preview_games import PreviewGames
from server.web.auth import token_of
from server.web.csrf import CsrfProtection
from server.web.dependencies import Web, games_first, plain_address, templates
from server.web.error_pages import install_error_pages
from server.web.guess_limits import Hashing
from server.web.head_and_redirects import Boundary
from server.web.health import Commits, metrics_of
from server.web.participant import exits, game_socket, study_pages, watch_agents
from server.web.participant.game_socket import Sockets
from server.web.participant.watch_agents import Demonstrations
from server.web.public_path import PublicPath
from server.web.rate_limits import EnrolmentLimits, Rates, rate_limit
from server.web.security_headers import SecurityHeaders
from server.web.services import Services

if TYPE_CHECKING:
    from server.cluster.game_owner import ClusterNode
    from server.monitoring.webhook import Webhook

log = logging.getLogger(__name__)
MAX_CLIENT_ERRORS = 100  # of one participant that are stored
_ROUTES = (study_pages, exits, game_socket, watch_agents, researcher_routes, health, protocol_document)


def create_app(settings: Settings) -> FastAPI:
    """Create the application with its routes; `wired` starts and stops its parts."""
    before = [Depends(rate_limit), Depends(plain_address), Depends(games_first)]
    app = FastAPI(title="kitchenmind", docs_url=None, redoc_url=None, openapi_url=None, dependencies=before)
    app.add_middleware(SecurityHeaders, secure=_csrf(settings).secure)
    app.add_middleware(Boundary)
    app.add_middleware(PublicPath, root=_csrf(settings).root)
    app.mount("/static", StaticFiles(directory=ROOT / "static"), name="static")
    install_error_pages(app)
    for module in _ROUTES:
        app.include_router(module.router)
    return app


def _csrf(settings: Settings) -> CsrfProtection:
    return CsrfProtection(settings.signing_key(), settings.public_url)


@asynccontextmanager
async def wired(
    app: FastAPI, settings: Settings, ahead: Launched | None = None, joins: bool = False
) -> AsyncIterator[None]:
    """Run the application with all its parts, as long as the context lasts. `ahead`: a model worker's process, launched
    already. `joins`: other processes of this server run already.

    Raises StudyError, ModelsDown, DatabaseInUse, DatabaseDown, DatabaseTooNew."""
    files, csrf = playable_studies(settings), _csrf(settings)
    async with AsyncExitStack() as stack:
        several = settings.redis is not None
        models = _models(settings, files, ahead)
        stack.push_async_callback(models.close)
        starting = asyncio.create_task(models.start())  # takes longest, in a separate process
        stack.push_async_callback(ended, starting)  # nothing keeps running when the server does not start
        # Starlette's thread pool, which imports its parts at the first call.
        await run_in_threadpool(warm_up.compile_all, files, csrf.root)
        if several:
            await asyncio.to_thread(migrate_shared, settings.database)
        database = Database(settings.database, shared=several, in_turn=several)
        stack.callback(database.close)
        if not several:
            await database.write(to_newest)
        await asyncio.to_thread(remove_abandoned)
        await asyncio.to_thread(write_kitchens, settings.own_kitchens, await database.read(kitchens.grids))
        studies = await Studies.opened(database, files)
        await starting
        production = settings.mode == "production"
        limits = EnrolmentLimits(settings.new_per_address, settings.signing_key(), counts_local=production)
        web = Web(database, studies, csrf, templates(csrf.root), limits, production)
        app.state.services = await _services(settings, files, web, models, stack, joins)
        warm_up.prepare_routes(app)
        gc.freeze()
        gc.set_threshold(*GARBAGE_THRESHOLDS)  # a full collection takes milliseconds; games make hardly any cycles
        gc.enable()
        loading = asyncio.create_task(asyncio.to_thread(load_rules))  # after the start, which it would delay
        stack.push_async_callback(ended, loading)
        yield


async def _services(
    settings: Settings, files: list[StudyFile], web: Web, models: ModelServer, stack: AsyncExitStack, joins: bool
) -> Services:
    """Connect the parts and start what works in the background; `stack` stops it."""
    node = await _node(settings, files, stack) if settings.redis is not None else None
    games = _games(settings, web.database, models, node)
    stack.push_async_callback(games.stop)
    peers = None if node is None else node.cluster
    versions = StudyVersions(settings, files, models, web.studies, None if peers is None else peers.processes)
    await versions.begin(web.database, joins)
    sockets = _sockets(web, games, versions)
    demonstrations, previews = _unstored(web, games, models, stack)
    live = LiveGames(web, games, sockets, peers)
    dashboard = Dashboard(live, _database_file(settings))
    control = await _control(web, games, versions, sockets, stack, shared=node is not None)
    hook = _webhook(settings)
    alerts = Alerts(live, dashboard.file, _teller(settings, hook), versions)
    rehearsals = Rehearsals(stack, settings.data)
    if node is not None:
        node.show(live, control, partial(_state, live, models, (alerts, versions, rehearsals)))
    services = Services(
        settings=settings,
        web=web,
        models=models,
        games=games,
        versions=versions,
        sockets=sockets,
        demonstrations=demonstrations,
        previews=previews,
        live=live,
        dashboard=dashboard,
        control=ClusterControl(control, peers),
        alerts=alerts,
        latency_history=LatencyHistory(live),
        rates=Rates(),
        hashing=Hashing(),
        commits=Commits(),
        rehearsals=rehearsals,
        reports=StudyReports(web.database, settings.database, stack),
    )
    _run(stack, alerts, services.latency_history, versions, LanguageFolder(settings.data), hook)
    return services


def _run(
    stack: AsyncExitStack, *works: "Alerts | LanguageFolder | LatencyHistory | StudyVersions | Webhook | None"
) -> None:
    """Start what works in the background; `stack` stops it."""
    stack.push_async_callback(ended, *(asyncio.create_task(work.run()) for work in works if work is not None))


def _state(live: LiveGames, models: ModelServer, parts: tuple[Alerts, StudyVersions, Rehearsals], name: str) -> Process:
    """Return the status of this process for the others."""
    alerts, versions, rehearsals = parts
    return Process(name, metrics_of(live, models), alerts.shared(), versions.served(), rehearsals.shared())


def _unstored(
    web: Web, games: Games, models: ModelServer, stack: AsyncExitStack
) -> tuple[Demonstrations, PreviewGames]:
    """Return the games that are not stored; `stack` stops them."""
    demonstrations = Demonstrations(games.with_recorder, web.studies, web.csrf.is_own_origin)
    previews = PreviewGames(games.with_recorder, web.csrf.is_own_origin, PreviewModels(models))
    stack.push_async_callback(demonstrations.games.stop)
    stack.push_async_callback(previews.games.stop)
    return demonstrations, previews


def _database_file(settings: Settings) -> Path | None:
    url = normal_url(settings.database)
    return Path(str(url.database)) if url.get_backend_name() == "sqlite" else None


async def _control(
    web: Web, games: Games, versions: StudyVersions, sockets: Sockets, stack: AsyncExitStack, shared: bool
) -> Control:
    control = Control(games, web.database, web.studies, versions, sockets.dismiss_deleted)
    await control.begin(shared)
    stack.push_async_callback(control.stop)
    return control


def _models(settings: Settings, files: Sequence[StudyFile], ahead: Launched | None) -> ModelServer:
    required = required_models(files)
    models = ModelServer(
        required.agents, required.predictors, settings.model_workers, grids=required.grids, ahead=ahead
    )
    models.paths = required.paths
    return models


async def _node(settings: Settings, files: list[StudyFile], stack: AsyncExitStack) -> "ClusterNode":
    """Start this process as one of several. Raises StudyError, ClusterDown, DatabaseDown."""
    from server.cluster.game_owner import ClusterNode, refuse_pairs
    from server.cluster.registry import Cluster
    from server.store.fences import FencedRecorder

    assert settings.redis is not None  # noqa: S101 the caller looked
    refuse_pairs(files)
    of_games = Database(settings.database, readers=2, shared=True)  # a tick must not wait behind a page's writes
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


def _sockets(web: Web, games: Games, versions: StudyVersions) -> Sockets:
    async def report(participant: str, text: str) -> None:
        event = events.Event("trouble", datetime.now(UTC), participant, detail={"text": text})
        try:
            await web.database.write(events.add_at_most, event, MAX_CLIENT_ERRORS)
        except DatabaseDown:
            log.warning("a problem in a browser could not be stored: %r", text)

    seats = Seating(web.database, web.studies, versions.fingerprint, code_version())

    async def find(connection: HTTPConnection, study: str) -> ConnectedPlayer | None:
        return await seats.find(token_of(connection), study)

    room = WaitingRoom(games.clock, seats.seat_two, seats.seat_alone, seats.outlook)
    return Sockets(games, find, web.csrf.is_own_origin, report, room)


def _webhook(settings: Settings) -> "Webhook | None":
    if not settings.alert_webhook:
        return None
    from server.monitoring.webhook import Webhook

    return Webhook(settings.alert_webhook.get_secret_value())


def _teller(settings: Settings, hook: "Webhook | None") -> Callable[[Alert, bool], None]:
    """Return a function that logs an alert, and posts it if the settings have a webhook."""

    def tell(alert: Alert, over: bool) -> None:
        log.log(logging.INFO if alert.study else logging.WARNING, "alert%s: %s", " over" if over else "", alert.text)
        if hook is not None:
            hook.send(message_of(alert, over, settings.public_url))

    return tell
