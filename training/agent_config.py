"""The settings of an agent's training (PPO), with CleanRL's names."""

import tomllib
from collections.abc import Sequence
from pathlib import Path
from typing import Annotated, Literal

from pydantic import Field

from models.networks.config import NetworkConfig
from training.settings import ConfigError, TrainingSettings, parsed_changes

CONFIG_FOLDER = Path(__file__).parent / "configs"


class AgentConfig(TrainingSettings):
    """How one agent learns by PPO. A run is defined by its config, its layout, its seed and its partners."""

    network: Literal["mlp", "cnn"] = Field("mlp", description="Network: an MLP, or the paper's CNN.")
    hidden: Annotated[tuple[Annotated[int, Field(ge=1)], ...], Field(strict=False)] = Field(
        (128, 64, 64), description="Widths of the fully connected layers."
    )
    filters: int = Field(25, ge=1, description="Filters of each convolution (CNN only).")
    total_timesteps: int = Field(
        4_000_000,
        ge=1,
        serialization_alias="timesteps",
        description="Timesteps of the environment, summed over all games.",
    )
    num_envs: int = Field(
        64, ge=1, serialization_alias="games", description="Games that run side by side in self-play."
    )
    num_steps: int = Field(
        100, ge=1, serialization_alias="rollout", description="Timesteps of each game between two updates (a rollout)."
    )
    update_epochs: int = Field(2, ge=1, serialization_alias="epochs", description="Passes over each rollout.")
    minibatch_size: int = Field(
        1280, ge=2, serialization_alias="minibatch", description="Samples in one gradient step."
    )
    learning_rate: float = Field(1e-3, ge=0, description="Learning rate of Adam at the start; it falls linearly.")
    final_learning_rate: float = Field(
        0.1, ge=0, description="Share of the learning rate that is left at the end of the run."
    )
    clip_coef: float = Field(
        0.2, ge=0, serialization_alias="clip", description="PPO's clipping range for the ratio of new to old policy."
    )
    gamma: float = Field(0.99, ge=0, le=1, serialization_alias="discount", description="Discount factor of rewards.")
    gae_lambda: float = Field(
        0.95, ge=0, le=1, serialization_alias="trace", description="Lambda of generalised advantage estimation."
    )
    vf_coef: float = Field(
        0.5, ge=0, serialization_alias="value_weight", description="Weight of the value loss; the policy loss has 1."
    )
    max_grad_norm: float = Field(
        0.5,
        ge=0,
        serialization_alias="gradient_norm",
        description="Gradients with a larger norm are scaled down to it.",
    )
    reward_scale: float = Field(0.1, ge=0, description="Factor from points to rewards.")
    ent_coef: float = Field(
        0.05, ge=0, serialization_alias="entropy", description="Weight of the entropy bonus at the start."
    )
    final_ent_coef: float = Field(
        0.005,
        ge=0,
        serialization_alias="final_entropy",
        description="Weight of the entropy bonus from `ent_coef_timesteps` on.",
    )
    ent_coef_timesteps: int = Field(
        2_000_000,
        ge=0,
        serialization_alias="entropy_timesteps",
        description="Timesteps over which the weight of the entropy bonus falls linearly.",
    )
    shaping_timesteps: int = Field(
        2_000_000, ge=0, description="Timesteps over which each chef's own shaped reward fades to zero."
    )
    # With less than the game's own 3.0, chefs carry onions until the soup is nearly done.
    dish_shaping: float = Field(3.0, ge=0, description="Shaped reward for taking a useful dish.")
    random_starts: float = Field(0.0, ge=0, le=1, description="Share of episodes that begin in a random state.")
    self_play_games: int = Field(
        24, ge=0, description="When training with partners: games in which the agent plays both chefs."
    )
    games_per_partner: int = Field(
        4, ge=4, multiple_of=4, description="When training with partners: games with each partner, seats alternating."
    )
    imitation_updates: int = Field(
        0, ge=0, description="Gradient steps towards the scripted planner before the first timestep (wide kitchens)."
    )
    imitation_noise: float = Field(
        0.3, ge=0, le=1, description="Share of random actions in the planner's games that are imitated."
    )
    snapshots: int = Field(
        60, ge=1, description="Copies of the network kept over the run, from which the skill levels are taken."
    )


def network_config(config: AgentConfig) -> NetworkConfig:
    """Return the shape of the network that such a run trains."""
    return NetworkConfig(config.network, config.filters, config.hidden)


def agent_config(name_or_path: str | Path | None, changes: Sequence[str] = ()) -> AgentConfig:
    """Return the config of a TOML file (or a name in training/configs) with `key=value` changes.

    Raises ConfigError.
    """
    config = AgentConfig()
    if name_or_path is not None:
        path = Path(name_or_path)
        if path.suffix != ".toml":
            path = CONFIG_FOLDER / f"{name_or_path}.toml"
        if not path.is_file():
            known = ", ".join(sorted(p.stem for p in CONFIG_FOLDER.glob("*.toml") if not p.stem.startswith("study_")))
            raise ConfigError(
                f"there is no config {str(name_or_path)!r}. Known: {known}; or give the path of a .toml file."
            )
        try:
            settings = tomllib.loads(path.read_text(encoding="utf-8"))
        except tomllib.TOMLDecodeError as error:
            raise ConfigError(f"{path}: {error}. Write lines like: total_timesteps = 4_000_000") from error
        config = config.changed(settings, str(path))
    return config.changed(parsed_changes(changes), "--set")
