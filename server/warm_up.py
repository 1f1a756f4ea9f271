"""Compile and prepare at the start what would otherwise delay a running game."""

from collections.abc import Sequence

from fastapi import FastAPI

from overcooked.constants import STAY
from server.participation.episode_specs import layout_of
from server.play.simulation import Simulation
from server.study.loader import StudyFile
from server.web.dependencies import compile_templates


def compile_all(files: Sequence[StudyFile], root: str = "") -> None:
    """Compile every page and the kernels of every study's first kitchen. `root`: see `CsrfProtection.root`."""
    compile_templates(root)
    for file in files:
        simulation = Simulation(layout_of(file.study.layouts[0]), horizon=1)
        simulation.step((STAY, STAY))


def prepare_routes(app: FastAPI) -> None:
    """Make FastAPI build each router's routes now: it would do so at the first request, and delay games by some 15 ms
    per router."""
    scope = {"type": "http", "method": "GET", "path": "/not a page", "root_path": ""}
    for route in app.router.routes:
        route.matches(scope)
