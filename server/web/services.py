"""The services that routes use. `server.main` makes them once, before the first request."""

from dataclasses import dataclass
from typing import TYPE_CHECKING, Annotated

from fastapi import Depends
from starlette.requests import HTTPConnection

if TYPE_CHECKING:  # their modules have routes, which need this one
    from models.inference.runner import ModelServer
    from server.cluster.command_dispatch import ClusterControl
    from server.monitoring.alerts import Alerts
    from server.monitoring.dashboard import Dashboard
    from server.monitoring.latency_history import LatencyHistory
    from server.monitoring.live_games import LiveGames
    from server.monitoring.rehearsals import Rehearsals
    from server.monitoring.report_making import StudyReports
    from server.participation.study_changes import Versions
    from server.play.games import Games
    from server.settings import Settings
    from server.web.admin.preview_games import PreviewGames
    from server.web.dependencies import Web
    from server.web.guess_limits import Hashing
    from server.web.health import Commits
    from server.web.participant.game_socket import Sockets
    from server.web.participant.watch_agents import Demonstrations
    from server.web.rate_limits import Rates


@dataclass(frozen=True)
class Services:
    """All parts of one server process; `app.state.services` is the only attribute of the application's state."""

    settings: "Settings"
    web: "Web"
    models: "ModelServer"
    games: "Games"
    versions: "Versions"
    sockets: "Sockets"
    demonstrations: "Demonstrations"
    previews: "PreviewGames"
    live: "LiveGames"
    dashboard: "Dashboard"
    control: "ClusterControl"
    alerts: "Alerts"
    latency_history: "LatencyHistory"
    rates: "Rates"
    hashing: "Hashing"
    commits: "Commits"
    rehearsals: "Rehearsals"
    reports: "StudyReports"


def services_of(connection: HTTPConnection) -> Services:
    """Return the parts of the server that got this request or socket."""
    services: Services = connection.app.state.services
    return services


ServicesDep = Annotated[Services, Depends(services_of)]
