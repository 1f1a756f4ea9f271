"""Put the finished training of a study among the bundled weights, from the folders that `--keep` wrote.

Agents that a kitchen had before stay as `sp_strong` and `fcp_strong`, with their predictors: they learned with more
than the paper's recipe and play better.
"""

import shutil
from collections.abc import Callable, Mapping
from pathlib import Path

from models.agents.catalogue import KINDS, WEIGHTS, strong
from models.networks.checkpoint import load_checkpoint, save_checkpoint
from overcooked.layout import Layout
from training.choose_agents import publish_from
from training.collect import CollectionPlan
from training.compact_predictor import compact
from training.pipeline.agent_tasks import prediction_tasks, study_tasks
from training.pipeline.predictor_tasks import FORMS
from training.pipeline.presets import Preset
from training.pipeline.study_tasks import Graph
from training.publish_predictor import population_folder, predictor_folder

Report = Callable[[str], None]
_NOT_NEEDED = ("games", "predictor", "weights")  # a task `intentions_...` has the predictor, too
_STORED = "Stored with 8 bits for each weight of a matrix."


def bundle(kept: Path, layout: Layout, preset: Preset, plan: CollectionPlan, report: Report) -> None:
    """Replace a kitchen's agents, population and predictors by those in `kept`/<layout>. Predictors and partners are
    stored with 8 bits, and predictors are measured again. `report` gets a line for each. Raises ValueError where a task
    is missing or was trained with other settings."""
    finished = _finished(kept, layout, preset)
    keep_strong(layout)
    shutil.rmtree(population_folder(layout), ignore_errors=True)
    publish_from(finished, layout, _copy_partner)
    report(f"{layout.name}: agents, population and held-out partners")
    for agent in KINDS:
        for form in FORMS:
            source, out = finished[f"intentions_{agent}_{form}"] / "predictor", predictor_folder(layout, agent, form)
            done = compact(source, out, plan, agent)
            report(f"{layout.name}/{out.name}: {done.before:.2%} right in 16 bits, {done.after:.2%} in 8")


def keep_strong(layout: Layout) -> None:
    """Rename a kitchen's agents and predictors to `sp_strong` and so on, unless it has both sets already."""
    here = WEIGHTS / layout.name
    for agent in KINDS:
        if (here / strong(agent)).exists() or not (here / agent).is_dir():
            continue
        for folder in sorted(here.glob(f"{agent}_predictor_*")):
            name_predicted_agent(folder, agent, strong(agent))
            folder.rename(here / folder.name.replace(agent, strong(agent), 1))
        (here / agent).rename(here / strong(agent))  # last: as long as it is there, the next command continues here


def name_predicted_agent(predictor: Path, agent: str, name: str) -> None:
    """Give the predicted agent another name in a predictor's config and card; the weights stay as they are."""
    found = load_checkpoint(predictor)
    card = found.card.replace(f"# Predictor of {agent} on ", f"# Predictor of {name} on ", 1)
    save_checkpoint(predictor, {**found.config, "agent": name}, found.tensors, card, found.bits)


def _finished(kept: Path, layout: Layout, preset: Preset) -> Mapping[str, Path]:
    """Return the folders of a kitchen's tasks by name, of all that the weights are made of."""
    graph = Graph([*study_tasks(layout.name, preset), *prediction_tasks(layout.name, preset)], kept)
    found = {graph.tasks[label].name: folder for label, folder in graph.kept_in(kept).items()}
    names = [task.name for task in graph.tasks.values() if not task.name.startswith(_NOT_NEEDED)]
    missing = [name for name in names if name not in found]
    if missing:
        raise ValueError(
            f"{kept / layout.name}: {', '.join(missing)} not finished with the settings of the preset {preset.name}. "
            f"Run `kitchenmind train study --preset {preset.name} --layouts {layout.name} --keep {kept}` first."
        )
    return {name: found[name] for name in names}


def _copy_partner(source: Path, target: Path) -> None:
    """Copy an agent that is only a partner, with 8 bits for each weight of its matrices."""
    found = load_checkpoint(source)
    card = found.card if _STORED in found.card else f"{found.card.rstrip()}\n\n{_STORED}"
    save_checkpoint(target, found.config, found.tensors, card, 8)
