"""Whether a study can be played on this machine: its kitchens, and the weights of its agents and predictors."""

import json
from collections.abc import Iterator

from models.blackbox import is_foreign
from overcooked.layout import LayoutError
from server.cast import WEIGHTS, Cast, cast_of, folder_of
from server.study.checks import Path, Problem
from server.study.loader import StudyFile
from server.study.plan import Kitchen
from server.web.episodes import layout_of


def stage_problems(file: StudyFile) -> Iterator[Problem]:
    """Kitchens that are none (errors), weights that are not there or belong to another grid (warnings, errors)."""
    study = file.study
    places: list[tuple[Path, Kitchen]] = [(("layouts", index), one) for index, one in enumerate(study.layouts)]
    places.append((("tutorial", "layout"), study.tutorial.layout))
    sound: dict[str, str] = {}
    for path, kitchen in places:
        try:
            sound[kitchen.name] = layout_of(kitchen).text
        except LayoutError as error:
            place = ", ".join(f"{word} {at}" for word, at in (("row", error.row), ("column", error.column)) if at)
            yield Problem((*path, "grid"), f"{place + ': ' if place else ''}{error.reason}", error.remedy)
        except FileNotFoundError as error:
            yield Problem(
                (*path, "name"), str(error).rstrip("."), "Correct the name, or draw the rows under `grid: |`."
            )
    if len(sound) == len({kitchen.name for _, kitchen in places}):  # a cast needs kitchens to stand in
        yield from _weight_problems(file, sound)


def _weight_problems(file: StudyFile, grids: dict[str, str]) -> Iterator[Problem]:
    cast = cast_of([file])
    layouts = [kitchen.name for kitchen in file.study.layouts]
    for layout in sorted({layout for layout, _ in cast.missing}):
        place: Path = ("layouts", layouts.index(layout)) if layout in layouts else ("tutorial",)
        models = ", ".join(model for at, model in cast.missing if at == layout)
        remedy = f"Train them (`kitchenmind train --help`), or name models that are there: {_there(layout)}."
        yield Problem(place, f"there are no weights for {layout} of: {models}", remedy, warning=True)
    yield from _degraded_problems(cast)
    for layout, model in sorted({*cast.agents, *cast.predictors}):
        config = folder_of(layout, model) / "config.json"
        if config.is_file() and layout in grids and json.loads(config.read_text("utf-8")).get("grid") != grids[layout]:
            place = ("layouts", layouts.index(layout)) if layout in layouts else ("tutorial", "layout")
            yield Problem(
                place, f"{model!r} was trained on another grid named {layout}", "Give the own grid an own name."
            )


def _degraded_problems(cast: Cast) -> Iterator[Problem]:
    """A predictor is made worse by leaving what it is right about, so it must be known how often it is right."""
    for layout, model in cast.predictors:
        name, _, wanted = model.rpartition("@")
        if not wanted.replace(".", "").isdigit() or (layout, model) in cast.missing:
            continue
        place: Path = ("conditions",)
        config = folder_of(layout, model) / "config.json"
        if is_foreign(name):
            reason = f"nobody knows how often {name!r} is right, so it cannot be made worse"
            yield Problem(place, reason, "Name a predictor of ours in the agent's `predictor`, or drop the condition.")
        elif config.is_file():
            reached = json.loads(config.read_text("utf-8")).get("accuracy", {}).get("mean", 1.0)
            if float(wanted) > 100 * reached:
                reason = f"{name} reaches {reached:.0%} on {layout}, so {wanted} % cannot be had by making it worse"
                yield Problem(place, reason, f"Write `accuracy: {int(100 * reached) / 100}` or less.")


def _there(layout: str) -> str:
    names = sorted(path.parent.name for path in (WEIGHTS / layout).glob("*/config.json"))
    return ", ".join([*names, "planner", "random", "stay"])
