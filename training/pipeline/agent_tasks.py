"""The tasks that make the agents of one kitchen: the population, the targets, the agent with the pretrained encoder,
the choice of the targets, and auxiliary partners that only predictors train with."""

from collections.abc import Sequence
from dataclasses import asdict
from functools import partial

from overcooked.layout import load_layout
from training.agent_config import AgentConfig
from training.choose_agents import choose_fcp, choose_sp, publish_agents
from training.pipeline.predictor_tasks import predictor_tasks
from training.pipeline.presets import AUXILIARY_ROLES, FIRST_SEEDS, ROLES, Preset, seeds
from training.pipeline.study_tasks import Task, Work
from training.runlog import RunFolder
from training.train_agent import PEOPLE, SKILLS, skill_snapshot, train_agent, write_agent

STUDY_LAYOUTS = ("coordination_ring", "double_rings", "double_counters", "matrix", "clear_division")
_OTHER_SEED = 1000  # is added to the seed of a run that never learned to cook
_TRIES = 3  # of a run, each with another seed
_CIRCLE = 5  # SP agents among the auxiliary partners that one of the FCP agents learns to cook with


def agent_tasks(layout: str, preset: Preset) -> list[Task]:
    """Return the tasks that train an agent for `layout`; their names are ROLE_SEED."""
    population = seeds("population_sp", preset)
    return [
        _agent_task(layout, preset, role, name, _partners(role, population))
        for role in ROLES
        for name in seeds(role, preset)
    ]


def auxiliary_tasks(layout: str, preset: Preset) -> list[Task]:
    """Return the auxiliary partners: SP agents, then FCP agents that learn with some of those and never meet the
    population."""
    count = preset.auxiliary_partners(layout)
    counts = zip(AUXILIARY_ROLES, (count, count // 2), strict=True)
    sp, fcp = ([f"{role}_{FIRST_SEEDS[role] + k}" for k in range(number)] for role, number in counts)
    alone = [_agent_task(layout, preset, AUXILIARY_ROLES[0], name, ()) for name in sp]
    circles = [tuple(sorted({sp[(k + j) % len(sp)] for j in range(_CIRCLE)})) for k in range(len(fcp))]
    return [
        *alone,
        *(
            _agent_task(layout, preset, AUXILIARY_ROLES[1], name, circle)
            for name, circle in zip(fcp, circles, strict=True)
        ),
    ]


def _agent_task(layout: str, preset: Preset, role: str, name: str, partners: tuple[str, ...]) -> Task:
    config = preset.config(layout, role, name)
    settings = {"config": config.differences(), "grid": load_layout(layout).text}
    minutes = config.total_timesteps / (50_000 if config.network == "mlp" else 7_000) / 60
    train = partial(_train, least_reward=preset.least_reward)
    return Task(layout, name, train, settings, partners, minutes)


def _partners(role: str, population: Sequence[str]) -> tuple[str, ...]:
    """Return the partners of a role. The target does not train with the last SP agent, which is kept to measure it."""
    if role == "target_fcp":
        return tuple(population[:-1])
    return tuple(population) if role in ("population_fcp", "features") else ()


def study_tasks(layout: str, preset: Preset) -> list[Task]:
    """Return all tasks for a kitchen's agents, inputs first: agents, the choice of targets, the weights (if the preset
    publishes)."""
    sp, fcp = seeds("target_sp", preset), seeds("target_fcp", preset)
    grid = load_layout(layout)
    agents = agent_tasks(layout, preset)
    settings = {"mode": asdict(PEOPLE)}
    last = seeds("population_sp", preset)[-1]
    choice = [
        Task(layout, "choose_sp", lambda work: choose_sp(work, grid), settings, tuple(sp)),
        Task(
            layout,
            "choose_fcp",
            lambda work: choose_fcp(work, grid),
            settings,
            ("choose_sp", *sp, *fcp, last, *seeds("population_fcp", preset)),
        ),
    ]
    if not preset.publish:
        return [*agents, *choice]
    everybody = tuple(task.name for task in (*agents, *choice) if not task.name.startswith("target_fcp"))
    return [*agents, *choice, Task(layout, "weights", lambda work: publish_agents(work, grid), {}, everybody, 0.1)]


def prediction_tasks(layout: str, preset: Preset) -> list[Task]:
    """Return the auxiliary partners of a kitchen and the predictors of both its targets; their inputs are tasks of
    `study_tasks`."""
    population = (*seeds("population_sp", preset), *seeds("population_fcp", preset))
    (encoder,) = seeds("features", preset)
    auxiliary = auxiliary_tasks(layout, preset)
    partners = (*population, *(task.name for task in auxiliary))
    settings = preset.predictor_settings(layout)
    extras = preset.forms_with_extras(layout)
    predictors = predictor_tasks(load_layout(layout), partners, encoder, settings, extras, preset.publish)
    return [*auxiliary, *predictors]


def _train(work: Work, least_reward: float = 0.0) -> None:
    """Train one agent and write its skill levels as checkpoints to <folder>/35, 70 and 100."""
    layout = load_layout(work.task.layout)
    config = AgentConfig().changed(work.task.settings["config"], work.task.label)
    partners = [folder / str(skill) for folder in work.inputs.values() for skill in SKILLS]
    role, _, seed = work.task.name.rpartition("_")
    runs: list[tuple[float, RunFolder]] = []
    for attempt in range(_TRIES):
        path = work.folder / ("run" if attempt == 0 else f"run_{attempt + 1}")
        number = int(seed) + _OTHER_SEED * attempt
        run = train_agent(config, layout, number, path, partners, lambda n, _: work.report(n / config.total_timesteps))
        _, reward, _ = skill_snapshot(run, 100)
        runs.append((reward, run))
        if reward >= least_reward:
            break
        print(f"{work.task.label}: {reward:.1f} points with seed {number}, fewer than {least_reward:g}", flush=True)
    _, best = max(runs, key=lambda one: one[0])
    for skill in SKILLS:
        write_agent(best, skill, work.folder / str(skill), f"{role}_{seed}_{skill}")
