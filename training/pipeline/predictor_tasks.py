"""The tasks that make a kitchen's predictors: games of each target, a predictor in each form, the published folders.

In kitchens with recorded human games, predictors also train with behaviour-cloned (BC) humans.
"""

import shutil
from collections.abc import Mapping, Sequence
from dataclasses import asdict
from functools import partial
from pathlib import Path
from typing import Any

from models.agents.catalogue import KINDS, our_agent
from models.networks.config import PredictorConfig
from overcooked.layout import Layout
from training.agents import SKILLS
from training.behaviour_cloning import RECORDED, companions, make_companions
from training.collect import TEST, CollectionPlan, Target, collect, read_manifest
from training.dataset import load_episodes
from training.pipeline.study_tasks import Task, Work
from training.population import load_extras, load_population, load_target, with_itself_and_extras
from training.predictor_config import Configs, IntentionSettings, TrainingConfig, changed
from training.publish_intentions import add_intentions
from training.publish_predictor import HowTrained, hashes_met, partners_met, predictor_folder, write_predictor
from training.runlog import RunFolder
from training.train_predictor import prepared, train_predictor

FORMS = ("stream", "window")
ENCODER, CLONES = "features", "clones"  # names of tasks


def predictor_tasks(
    layout: Layout,
    partners: Sequence[str],
    encoder: str,
    settings: Mapping[str, Any],
    extras: bool = True,
    publish: bool = True,
) -> list[Task]:
    """Return the games and predictors for both targets of a kitchen, inputs first. `partners` (the population, and
    auxiliary partners that are only trained with) and `encoder` are names of tasks that leave checkpoints; `settings`
    change the configs for all forms, or in a table for one. Without `extras` the games are those with the paper's 31
    partners; with `publish` the predictors also replace those in models/weights."""
    tasks = []
    if extras and layout.name in RECORDED:
        found = companions(RECORDED[layout.name]).items()
        clones = {name: [asdict(config), asdict(mode)] for name, (config, mode) in found}
        tasks.append(Task(layout.name, CLONES, partial(_train_human_bc, layout), clones, (), 2.0))
        partners = (*partners, CLONES)
    for agent in KINDS:
        chosen, games = f"choose_{agent}", f"games_{agent}"
        inputs: tuple[str, ...] = (chosen, *partners)
        plan = asdict(CollectionPlan()) if extras else {**asdict(CollectionPlan()), "extras": False}
        tasks.append(Task(layout.name, games, partial(_collect, layout, agent, extras), plan, inputs))
        for form in FORMS:
            configs = _configs(form, settings)
            facts = {"network": asdict(configs[0]), "training": configs[1].stored()}
            inputs = (games, chosen, encoder) if configs[0].eyes == "cnn" else (games, chosen)
            action = partial(_train, layout, agent, configs, publish)
            tasks.append(Task(layout.name, f"predictor_{agent}_{form}", action, facts, inputs, 10.0))
            say = partial(_add_intentions, layout, agent, form, publish)
            settings_of_intentions = IntentionSettings().stored()
            trained = (games, f"predictor_{agent}_{form}")
            tasks.append(Task(layout.name, f"intentions_{agent}_{form}", say, settings_of_intentions, trained, 3.0))
    return tasks


def _configs(form: str, settings: Mapping[str, Any]) -> Configs:
    own = {key: value for key, value in settings.items() if not isinstance(value, Mapping)}
    own.update(settings.get(form, {}))
    return changed((PredictorConfig(form=form), TrainingConfig(minutes=1e9)), own, f"[predictor] {form}")


def _target(work: Work, layout: Layout, agent: str) -> Target:
    found = load_target(str(work.inputs[f"choose_{agent}"] / "agent"), layout)
    return Target(agent, found.policy, found.mode, found.sha256)


def _train_human_bc(layout: Layout, work: Work) -> None:
    make_companions(work.folder, layout)


def _collect(layout: Layout, agent: str, extras: bool, work: Work) -> None:
    target = _target(work, layout, agent)
    folders = [folder for _, folder in _inputs(work, "population")]
    partners = with_itself_and_extras(target, load_population(folders, layout), layout, extras)
    auxiliary = {f"{name}_{k}": folder / str(k) for name, folder in _inputs(work, "crowd") for k in SKILLS}
    clones = {name: at / name for _, at in _inputs(work, CLONES) for name in companions(RECORDED[layout.name])}
    partners += load_extras({**auxiliary, **clones}, layout)
    collect(work.folder / "games", layout, target, partners, CollectionPlan(), work.report)


def _inputs(work: Work, prefix: str) -> list[tuple[str, Path]]:
    return [(name, folder) for name, folder in work.inputs.items() if name.startswith(prefix)]


def _train(layout: Layout, agent: str, configs: Configs, publish: bool, work: Work) -> None:
    """Train a predictor and write it to <folder>/predictor and, if wanted, among the bundled weights."""
    games = work.inputs[f"games_{agent}"] / "games"
    encoder: Path | None = next((folder / "100" for _, folder in _inputs(work, ENCODER)), None)
    network, training = configs
    trainer = prepared(layout, network, training, games, encoder)
    run = RunFolder(work.folder / "run", work.task.settings)
    trained = train_predictor(trainer, run, lambda share, _: work.report(share))
    counts = {"updates": trainer.update, "training games": len(trainer.train)}
    manifest = read_manifest(games)
    how = HowTrained({**counts, **partners_met(manifest), **work.task.settings}, hashes_met(manifest))
    test = load_episodes(games, TEST, layout, trained.encoder)
    published = [_bundled(layout, agent, network.form)] if publish else []
    for folder in (work.folder / "predictor", *published):
        write_predictor(folder, trained, layout, _target(work, layout, agent), test, how)


def _add_intentions(layout: Layout, agent: str, form: str, publish: bool, work: Work) -> None:
    """Add a decoder of intentions and write the predictor to <folder>/predictor and, if wanted, among the bundled
    weights."""
    trained = work.inputs[f"predictor_{agent}_{form}"] / "predictor"
    settings = IntentionSettings.checked(work.task.settings, work.task.label)
    out = work.folder / "predictor"
    add_intentions(trained, work.inputs[f"games_{agent}"] / "games", settings, out, work.report)
    if publish:
        shutil.copytree(out, _bundled(layout, agent, form), dirs_exist_ok=True)


def _bundled(layout: Layout, agent: str, form: str) -> Path:
    """Return the folder of a bundled predictor of an agent that `training.choose.publish_agents` publishes."""
    return predictor_folder(layout, our_agent(agent, layout.name), form)
