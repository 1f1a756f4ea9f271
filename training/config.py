"""The settings of a training run: frozen, a sentence each. An unknown key is an error that names the known ones."""

import tomllib
from collections.abc import Sequence
from dataclasses import dataclass, fields, replace
from pathlib import Path
from typing import Any

from models.networks.config import NetworkConfig

CONFIG_FOLDER = Path(__file__).parent / "configs"


class ConfigError(ValueError):
    """A setting that does not exist or cannot be; says where and what to write instead."""


@dataclass(frozen=True)
class AgentConfig:
    """How one agent learns by PPO. A run is defined by its config, its layout, its seed and its partners."""

    network: str = "mlp"  # "mlp" or the paper's "cnn"
    hidden: tuple[int, ...] = (128, 64, 64)  # widths of the fully connected layers
    filters: int = 25  # of each convolution (cnn only)
    timesteps: int = 4_000_000  # of the environment, summed over its games
    games: int = 64  # that run side by side in self-play
    rollout: int = 100  # timesteps of each game between two updates
    epochs: int = 2  # passes over each rollout
    minibatch: int = 1280  # samples in one gradient step
    learning_rate: float = 1e-3  # of Adam at the start; falls in a straight line
    final_learning_rate: float = 0.1  # share of the learning rate that is left at the end
    clip: float = 0.2  # how far the policy may move from the one that played (PPO's ratio)
    discount: float = 0.99  # gamma
    trace: float = 0.95  # lambda of generalised advantage estimation
    value_weight: float = 0.5  # of the value loss beside the policy loss
    gradient_norm: float = 0.5  # larger gradients are scaled down to this
    reward_scale: float = 0.1  # points to reward
    entropy: float = 0.05  # bonus for an undecided policy at the start
    final_entropy: float = 0.005  # the same from `entropy_timesteps` on
    entropy_timesteps: int = 2_000_000  # over which the bonus falls in a straight line
    shaping_timesteps: int = 2_000_000  # over which the own shaped reward fades to nothing
    dish_shaping: float = 3.0  # of it for a useful dish; where less, chefs carry onions until the soup is nearly done
    random_starts: float = 0.0  # share of episodes that begin in a random state
    self_play_games: int = 24  # with partners: games that both chefs play with the learner itself
    games_per_partner: int = 4  # with partners: games with each of them, seats in turn
    imitation_updates: int = 0  # gradient steps towards the scripted planner before the first timestep (wide kitchens)
    imitation_noise: float = 0.3  # share of random actions while the planner shows how
    snapshots: int = 60  # copies of the network kept over the run, from which the skill levels are taken


def network_config(config: AgentConfig) -> NetworkConfig:
    """The shape of the network that such a run trains."""
    return NetworkConfig(config.network, config.filters, config.hidden)


def differences(config: AgentConfig) -> dict[str, Any]:
    """The settings that are not the defaults. They name a run, so a new setting makes no stranger of an old run."""
    pairs = ((field.name, getattr(config, field.name)) for field in fields(config))
    changes = {name: value for name, value in pairs if value != getattr(AgentConfig(), name)}
    return {name: list(value) if isinstance(value, tuple) else value for name, value in changes.items()}


def agent_config(name_or_path: str | Path | None, changes: Sequence[str] = ()) -> AgentConfig:
    """The config of a TOML file (or a name in training/configs), then `key=value` changes. Raises ConfigError."""
    config = AgentConfig()
    if name_or_path is not None:
        path = Path(name_or_path)
        if path.suffix != ".toml":
            path = CONFIG_FOLDER / f"{name_or_path}.toml"
        if not path.is_file():
            known = ", ".join(sorted(p.stem for p in CONFIG_FOLDER.glob("*.toml")))
            raise ConfigError(
                f"there is no config {str(name_or_path)!r}. Known: {known}; or give the path of a .toml file."
            )
        try:
            settings = tomllib.loads(path.read_text(encoding="utf-8"))
        except tomllib.TOMLDecodeError as error:
            raise ConfigError(f"{path}: {error}. Write lines like: timesteps = 4_000_000") from error
        config = changed(config, settings, str(path))
    for change in changes:
        key, equals, text = change.partition("=")
        if not equals:
            raise ConfigError(f"--set {change}: write it as key=value, e.g. --set timesteps=1000000")
        config = changed(config, {key.strip(): _parsed(text.strip())}, "--set")
    return config


def changed(config: AgentConfig, settings: dict[str, Any], source: str) -> AgentConfig:
    """`config` with `settings`, each checked against the type of its default. Raises ConfigError naming `source`."""
    known = {field.name: getattr(config, field.name) for field in fields(config)}
    checked = {}
    for key, value in settings.items():
        if key not in known:
            raise ConfigError(f"{source}: unknown key {key!r}. Known: {', '.join(known)}.")
        checked[key] = _as(type(known[key]), value, f"{source}: {key}")
    config = replace(config, **checked)
    if config.network not in ("mlp", "cnn"):
        raise ConfigError(f"{source}: network is {config.network!r}. Write mlp or cnn.")
    if config.games_per_partner % 4:
        raise ConfigError(f"{source}: games_per_partner is {config.games_per_partner}. Write a multiple of 4.")
    return config


def _parsed(text: str) -> Any:
    try:
        return tomllib.loads(f"x = {text}")["x"]
    except tomllib.TOMLDecodeError:
        return text


def _as(wanted: type, value: Any, place: str) -> Any:
    if wanted is tuple and isinstance(value, list) and all(isinstance(item, int) for item in value):
        return tuple(value)
    if wanted is float and isinstance(value, int) and not isinstance(value, bool):
        return float(value)
    if type(value) is not wanted:
        raise ConfigError(f"{place} is {value!r}. Write a value of type {wanted.__name__}.")
    if isinstance(value, int | float) and value < 0:
        raise ConfigError(f"{place} is {value!r}. It cannot be negative.")
    return value
