"""What the kitchen editor shows of a grid: errors with their place, what can be reached, models, planners' points."""

import asyncio
import json
import os
import subprocess
import sys
from pathlib import Path
from typing import Any, Final

from fastapi import HTTPException

from overcooked.layout import Layout, layout_problems, parse_layout
from overcooked.layout_file import LayoutError, grid_rows
from overcooked.reach import KitchenReach, kitchen_reach
from server.participation.own_kitchens import trained_models
from server.participation.training_commands import is_file_ready, training_commands
from server.settings import ROOT, program
from server.study.checks import capitalised

EPISODES: Final = 5
TIMEOUT_S: Final = 90
MAX_KEPT: Final = 100
_DRAWING: Final = "kitchen"  # the name of the file in errors
_one_at_a_time = asyncio.Lock()
_trials: dict[str, dict[str, Any]] = {}  # by the hash of the grid


def findings(text: str, name: str, own_models: Path) -> dict[str, Any]:
    """Return what is known of a grid, or of the text of a `.layout` file, at once. `rows` is None if there are none."""
    try:
        rows: list[str] | None = grid_rows(text, _DRAWING)
    except LayoutError:
        rows = None
    problems = [
        {"row": one.row, "column": one.column, "text": f"{capitalised(one.reason)}. {one.remedy}"}
        for one in layout_problems(text, _DRAWING)
    ]
    found: dict[str, Any] = {"rows": rows, "problems": problems, "reach": None, "models": None}
    if not problems:
        layout = parse_layout(text, name or _DRAWING)
        found |= {"reach": _reach(kitchen_reach(layout)), "models": _models(layout, own_models)}
        found["trial"] = _trials.get(layout.sha256)
    return found


def _reach(reach: KitchenReach) -> dict[str, Any]:
    return {
        "stations": [sorted(cells) for cells in reach.stations],
        "shared": sorted(reach.shared),
        "alone": list(reach.alone),
        "together": reach.together,
        "unused": sorted(reach.unused),
    }


def _models(layout: Layout, own_models: Path) -> dict[str, Any]:
    found = trained_models(layout, own_models)
    commands = training_commands(layout.name, own_models, layout.text)
    every = [commands.agent(), *commands.partners(), commands.collect(), commands.predictor()]
    return {
        "layout": found.layout,
        "scripted": list(found.scripted),
        "agents": list(found.agents),
        "predictors": list(found.predictors),
        "other_grid": list(found.other_grid),
        "is_taken": commands.is_taken,
        "is_saved": is_file_ready(layout.name, layout.text, own_models),
        "folder": str(Path.cwd()),
        "results": str(commands.models / layout.name),
        "commands": [f"{program()}{command.removeprefix('kitchenmind')}" for command in every],
    }


async def trial(text: str) -> dict[str, Any]:
    """Return the points of two planners and how often they block each other. One at a time; the games do not notice,
    as it runs in a process that waits for them. Answers 400 for an invalid grid, 503 if another one is tried."""
    try:
        layout = parse_layout(text, _DRAWING)
    except LayoutError as error:
        raise HTTPException(400, str(error)) from None
    if (known := _trials.get(layout.sha256)) is not None:
        return known
    if _one_at_a_time.locked():
        raise HTTPException(503, "Another kitchen is being tried. Wait a moment and try again.", {"Retry-After": "2"})
    async with _one_at_a_time:  # taken before anything else is awaited
        found = await asyncio.to_thread(_tried, layout.text)
    while len(_trials) >= MAX_KEPT:
        _trials.pop(next(iter(_trials)))
    _trials[layout.sha256] = found
    return found


def _tried(grid: str) -> dict[str, Any]:
    path = os.pathsep.join(filter(None, (str(ROOT), os.environ.get("PYTHONPATH"))))
    one_thread = dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "NUMBA_NUM_THREADS"), "1")
    try:
        done = subprocess.run(  # noqa: S603
            [sys.executable, "-m", "server.commands.kitchen_trial", str(EPISODES)],
            input=grid.encode(),
            env={**os.environ, "PYTHONPATH": path, **one_thread},
            capture_output=True,
            timeout=TIMEOUT_S,
            check=True,
        )
    except subprocess.TimeoutExpired:
        raise HTTPException(
            503,
            f"The trial took longer than {TIMEOUT_S} s and was stopped. Try again when fewer games run.",
        ) from None
    except subprocess.CalledProcessError as error:
        raise HTTPException(500, error.stderr.decode(errors="replace")[-300:]) from None
    found: dict[str, Any] = json.loads(done.stdout)
    return found
