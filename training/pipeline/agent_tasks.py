"""The tasks that make the agents of one kitchen: the population, the targets, the feature lender, their choice, and a
crowd of further agents that only predictors learn with.

It must not know how tasks are scheduled. Presets are TOML files in training/configs (`study_*.toml`).
"""

import tomllib
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from functools import partial
from pathlib import Path
from typing import Any

from overcooked.layout import load_layout
from training.agents import PEOPLE, SKILLS, ship, skill_snapshot, train_agent
from training.choose import choose_fcp, choose_sp, ship_cast
from training.config import CONFIG_FOLDER, AgentConfig, ConfigError, changed, differences
from training.pipeline.predictor_tasks import predictor_tasks
from training.pipeline.study_tasks import Task, Work

STUDY_LAYOUTS = ("coordination_ring", "double_rings", "double_counters", "matrix", "clear_division")
ROLES = ("population_sp", "target_sp", "population_fcp", "target_fcp", "features")
CROWD = ("crowd_sp", "crowd_fcp")
_SEEDS = {
    "population_sp": 1, "target_sp": 11, "population_fcp": 21, "target_fcp": 31, "features": 41,
    "crowd_sp": 101, "crowd_fcp": 201,
}  # fmt: skip
_OTHER_SEED = 1000  # is added to the seed of a run that never learned to cook
_TRIES = 3  # of a run, each with another seed
_CIRCLE = 5  # SP agents of the crowd that one of its FCP agents learns to cook with


@dataclass(frozen=True)
class Preset:
    """How large a study's cast is and how long everybody trains."""

    name: str
    population: int
    targets: int
    settings: dict[str, Any]
    least_reward: float = 0.0  # a run whose best reward is lower is trained again with another seed
    extras: bool = True  # whether predictors also learn with partners that the paper does not have
    ship: bool = True  # whether the results replace the weights in models/weights

    def crowd(self, layout: str) -> int:
        """How many SP agents, and half as many FCP agents, join those that the kitchen's predictors learn with."""
        return int(self.settings.get("layout", {}).get(layout, {}).get("crowd", 0))

    def config(self, layout: str, role: str, run: str = "") -> AgentConfig:
        """The training config of a role in a kitchen, and of one of its runs; the crowd learns as the population does.
        Raises ConfigError."""
        role = role.replace("crowd", "population")
        here = self.settings.get("layout", {}).get(layout, {})
        config = AgentConfig()
        for tables, prefix in ((self.settings, ""), (here, f"layout.{layout}.")):
            for name in (role, run):
                config = changed(config, tables.get(name, {}), f"{self.name}: [{prefix}{name}]")
        return config


def load_preset(name: str) -> Preset:
    """A preset by its name, e.g. cpu, or a TOML file. Raises ConfigError."""
    path = Path(name) if name.endswith(".toml") else CONFIG_FOLDER / f"study_{name}.toml"
    if not path.is_file():
        known = ", ".join(sorted(p.stem.removeprefix("study_") for p in CONFIG_FOLDER.glob("study_*.toml")))
        raise ConfigError(f"there is no preset {name!r}. Known: {known}.")
    settings = tomllib.loads(path.read_text(encoding="utf-8"))
    numbers = {key: value for key, value in settings.items() if not isinstance(value, dict)}
    types = {"population": int, "targets": int, "least_reward": float, "extras": bool, "ship": bool}
    for key, value in numbers.items():
        if type(value) is not types.get(key):
            words = f"Write a {types[key].__name__}" if key in types else f"Known: {', '.join(types)} and tables"
            raise ConfigError(f"{path}: {key} = {value!r}. {words}.")
    if missing := {"population", "targets"} - set(numbers):
        raise ConfigError(f"{path}: {' and '.join(sorted(missing))} missing. Write, e.g., population = 5.")
    return Preset(name, settings={key: settings[key] for key in settings.keys() - numbers.keys()}, **numbers)


def agent_tasks(layout: str, preset: Preset) -> list[Task]:
    """Everything that trains an agent for `layout`: names are ROLE_SEED."""
    population = seeds("population_sp", preset)
    return [
        _agent_task(layout, preset, role, name, _partners(role, population))
        for role in ROLES
        for name in seeds(role, preset)
    ]


def crowd_tasks(layout: str, preset: Preset) -> list[Task]:
    """The crowd: SP agents, then FCP agents that learn with some of those and never meet the population."""
    counts = zip(CROWD, (preset.crowd(layout), preset.crowd(layout) // 2), strict=True)
    sp, fcp = ([f"{role}_{_SEEDS[role] + k}" for k in range(count)] for role, count in counts)
    alone = [_agent_task(layout, preset, CROWD[0], name, ()) for name in sp]
    circles = [tuple(sorted({sp[(k + j) % len(sp)] for j in range(_CIRCLE)})) for k in range(len(fcp))]
    return [
        *alone,
        *(_agent_task(layout, preset, CROWD[1], name, circle) for name, circle in zip(fcp, circles, strict=True)),
    ]


def _agent_task(layout: str, preset: Preset, role: str, name: str, partners: tuple[str, ...]) -> Task:
    config = preset.config(layout, role, name)
    settings = {"config": differences(config), "grid": load_layout(layout).text}
    minutes = config.timesteps / (50_000 if config.network == "mlp" else 7_000) / 60
    train = partial(_train, least_reward=preset.least_reward)
    return Task(layout, name, train, settings, partners, minutes)


def _partners(role: str, population: Sequence[str]) -> tuple[str, ...]:
    """Whom a role learns to cook with. The last SP agent is kept from the target: it will be measured with it."""
    if role == "target_fcp":
        return tuple(population[:-1])
    return tuple(population) if role in ("population_fcp", "features") else ()


def study_tasks(layout: str, preset: Preset) -> list[Task]:
    """The whole cast of a kitchen, inputs first: agents, the choice of targets, the weights (if the preset ships)."""
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
    if not preset.ship:
        return [*agents, *choice]
    everybody = tuple(task.name for task in (*agents, *choice) if not task.name.startswith("target_fcp"))
    return [*agents, *choice, Task(layout, "weights", lambda work: ship_cast(work, grid), {}, everybody, 0.1)]


def prediction_tasks(layout: str, preset: Preset) -> list[Task]:
    """The crowd of a kitchen and the predictors of both its targets; their inputs are tasks of `study_tasks`."""
    population = (*seeds("population_sp", preset), *seeds("population_fcp", preset))
    (lender,) = seeds("features", preset)
    crowd = crowd_tasks(layout, preset)
    partners = (*population, *(task.name for task in crowd))
    here = preset.settings.get("layout", {}).get(layout, {})
    settings = {**preset.settings.get("predictor", {}), **here.get("predictor", {})}
    return [*crowd, *predictor_tasks(load_layout(layout), partners, lender, settings, preset.extras, preset.ship)]


def seeds(role: str, preset: Preset) -> list[str]:
    """The names of a role's runs."""
    count = {"features": 1, "population_sp": preset.population, "population_fcp": preset.population}.get(
        role, preset.targets
    )
    return [f"{role}_{_SEEDS[role] + k}" for k in range(count)]


def _train(work: Work, least_reward: float = 0.0) -> None:
    """Train one agent and leave its skill levels as checkpoints in <folder>/35, 70 and 100."""
    layout = load_layout(work.task.layout)
    config = changed(AgentConfig(), work.task.settings["config"], work.task.label)
    partners = [folder / str(skill) for folder in work.inputs.values() for skill in SKILLS]
    role, _, seed = work.task.name.rpartition("_")
    for attempt in range(_TRIES):
        path = work.folder / ("run" if attempt == 0 else f"run_{attempt + 1}")
        number = int(seed) + _OTHER_SEED * attempt
        run = train_agent(config, layout, number, path, partners, lambda n, _: work.report(n / config.timesteps))
        _, reward, _ = skill_snapshot(run, 100)
        if reward >= least_reward:
            break
        print(f"{work.task.label}: {reward:.1f} points with seed {number}, fewer than {least_reward:g}", flush=True)
    for skill in SKILLS:
        ship(run, skill, work.folder / str(skill), f"{role}_{seed}_{skill}")
