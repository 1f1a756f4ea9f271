"""The tasks that make a kitchen's predictors: games of each target, a predictor in each form, the published folders.

In kitchens with recorded human games, predictors also train with behaviour-cloned (BC) humans.
"""

import shutil
from collections.abc import Collection, Mapping, Sequence
from dataclasses import asdict
from functools import partial
from pathlib import Path
from typing import Any

from models.agents.catalogue import KINDS, our_agent
from models.networks.config import PredictorConfig
from overcooked.layout import Layout
from training.behaviour_cloning import RECORDED, companions, make_companions
from training.collect import TEST, CollectionPlan, Target, collect, read_manifest
from training.dataset import load_episodes
from training.pipeline.study_tasks import Task, Work
from training.population import load_extras, load_population, load_target, with_itself_and_extras
from training.predictor_config import Configs, IntentionSettings, TrainingConfig, changed
from training.publish_intentions import add_intentions
from training.publish_predictor import HowTrained, hashes_met, partners_met, predictor_folder, write_predictor
from training.runlog import RunFolder
from training.train_agent import SKILLS
from training.train_predictor import prepared, train_predictor

FORMS = ("stream", "window")
ENCODER, CLONES = "features", "clones"  # names of tasks


def predictor_tasks(
    layout: Layout,
    partners: Sequence[str],
    encoder: str,
    settings: Mapping[str, Any],
    extras: Collection[str] = FORMS,
    publish: bool = True,
) -> list[Task]:
    """Return the games and predictors for both targets of a kitchen, inputs first. `partners` (the population, and
    auxiliary partners that are only trained with) and `encoder` are names of tasks that leave checkpoints; `settings`
    change the configs for all forms, or in a table for one. The forms in `extras` also learn from games with partners
    that the paper does not have, the others from those with its 31 partners; with `publish` the predictors also replace
    those in models/weights."""
    tasks = []
    clones: tuple[str, ...] = ()
    if extras and layout.name in RECORDED:
        found = companions(RECORDED[layout.name]).items()
        imitating = {name: [asdict(config), asdict(mode)] for name, (config, mode) in found}
        tasks.append(Task(layout.name, CLONES, partial(_train_human_bc, layout), imitating, (), 2.0))
        clones = (CLONES,)
    for agent in KINDS:
        for more in sorted({form in extras for form in FORMS}):
            plan = asdict(CollectionPlan()) if more else {**asdict(CollectionPlan()), "extras": False}
            inputs = (f"choose_{agent}", *partners, *(clones if more else ()))
            collecting = partial(_collect, layout, agent, more)
            tasks.append(Task(layout.name, _games(agent, more, extras), collecting, plan, inputs))
        for form in FORMS:
            games = _games(agent, form in extras, extras)
            tasks += _form_tasks(layout, agent, _configs(form, settings), (games, encoder), publish)
    return tasks


def _form_tasks(
    layout: Layout, agent: str, configs: Configs, inputs: tuple[str, str], publish: bool
) -> tuple[Task, Task]:
    """Return a predictor and its decoder of intentions. `inputs`: the tasks of its games and of the encoder."""
    (games, encoder), form = inputs, configs[0].form
    facts = {"network": asdict(configs[0]), "training": configs[1].stored()}
    needed = (games, f"choose_{agent}", encoder) if configs[0].eyes == "cnn" else (games, f"choose_{agent}")
    name = f"predictor_{agent}_{form}"
    training = partial(_train, layout, agent, configs, publish)
    adding = partial(_add_intentions, layout, agent, form, publish)
    return (
        Task(layout.name, name, training, facts, needed, 10.0),
        Task(layout.name, f"intentions_{agent}_{form}", adding, IntentionSettings().stored(), (games, name), 3.0),
    )


def _games(agent: str, more: bool, extras: Collection[str]) -> str:
    """Return the name of the task that collects an agent's games; `more`: with extra partners."""
    return f"games_{agent}_extras" if more and set(extras) != set(FORMS) else f"games_{agent}"


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


def _games_of(work: Work) -> Path:
    """Return where the games are that a predictor learns from."""
    ((_, folder),) = _inputs(work, "games_")
    return folder / "games"


def _inputs(work: Work, prefix: str) -> list[tuple[str, Path]]:
    return [(name, folder) for name, folder in work.inputs.items() if name.startswith(prefix)]


def _train(layout: Layout, agent: str, configs: Configs, publish: bool, work: Work) -> None:
    """Train a predictor and write it to <folder>/predictor and, if wanted, among the bundled weights."""
    games = _games_of(work)
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
    add_intentions(trained, _games_of(work), settings, out, work.report)
    if publish:
        shutil.copytree(out, _bundled(layout, agent, form), dirs_exist_ok=True)


def _bundled(layout: Layout, agent: str, form: str) -> Path:
    """Return the folder of a bundled predictor of an agent that `training.choose_agents.publish_agents` publishes."""
    return predictor_folder(layout, our_agent(agent, layout.name), form)
