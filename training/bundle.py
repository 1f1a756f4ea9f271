"""Put a finished study of the preset `published` among the bundled weights, from the folders that `--keep` wrote.

Agents that a kitchen had before stay as `sp_strong` and `fcp_strong`, with their predictors: they learned with more
than the paper's recipe and play better.
"""

import shutil
from collections.abc import Callable
from pathlib import Path

from models.agents.catalogue import WEIGHTS, strong
from overcooked.layout import Layout
from training.choose import publish_from
from training.collect import CollectionPlan
from training.compact_predictor import compact
from training.pipeline.predictor_tasks import AGENTS, FORMS
from training.publish_predictor import predictor_folder

Told = Callable[[str], None]


def bundle(kept: Path, layout: Layout, plan: CollectionPlan, told: Told) -> None:
    """Replace a kitchen's agents, population and predictors by those in `kept`/<layout>; predictors are stored in 8
    bits and measured again. `told` gets a line for each. Raises ValueError where a task is missing."""
    finished = {key.parent.name: key.parent for key in sorted((kept / layout.name).glob("*/key"))}
    wanted = [f"intentions_{agent}_{form}" for agent in AGENTS for form in FORMS]
    missing = [name for name in ("choose_sp", "choose_fcp", *wanted) if name not in finished]
    if missing:
        raise ValueError(
            f"{kept / layout.name}: {', '.join(missing)} not finished. Run "
            f"`kitchenmind train study --preset published --layouts {layout.name} --keep {kept}` to its end first."
        )
    keep_strong(layout)
    publish_from(finished, layout)
    told(f"{layout.name}: agents, population and partners never met")
    for agent in AGENTS:
        for form in FORMS:
            source, out = finished[f"intentions_{agent}_{form}"] / "predictor", predictor_folder(layout, agent, form)
            shutil.rmtree(out, ignore_errors=True)
            done = compact(source, out, plan, agent)
            told(f"{layout.name}/{out.name}: {done.before:.2%} right in 16 bits, {done.after:.2%} in 8")


def keep_strong(layout: Layout) -> None:
    """Rename a kitchen's agents and predictors to `sp_strong` and so on, unless it has both sets already."""
    here = WEIGHTS / layout.name
    for agent in AGENTS:
        if (here / strong(agent)).exists() or not (here / agent).is_dir():
            continue
        (here / agent).rename(here / strong(agent))
        for folder in sorted(here.glob(f"{agent}_predictor_*")):
            folder.rename(here / folder.name.replace(agent, strong(agent), 1))
