"""Settings of a predictor's training. The network's own are in `models.networks.predictor`; unknown keys are errors."""

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, fields
from typing import Any

from models.networks.config import PredictorConfig
from training.config import ConfigError


@dataclass(frozen=True)
class TrainingConfig:
    """How a predictor learns."""

    updates: int = 6000  # at most
    learning_rate: float = 1e-3  # the paper's; warms up, then falls along a cosine to a hundredth
    warm_up: int = 100  # updates
    stretches: int = 24  # stream: stretches of games in an update
    stretch: int = 100  # timesteps of one
    windows: int = 512  # window: windows in an update
    partner_weight: float = 0.0  # of predicting the partner too, by a decoder that is not kept
    weight_decay: float = 0.02
    gradient_norm: float = 1.0
    averaging: float = 0.998  # of the weights that are kept and shipped (exponential moving average)
    check_every: int = 250  # updates between two looks at validation
    patience: int = 8  # looks without a better one before it stops
    minutes: float = 15.0  # of this process, at most; the same command continues later
    seed: int = 0


# What `train predictor --preset` may name: settings other than the defaults.
PRESETS: Mapping[str, Mapping[str, Any]] = {
    "full": {},
    "tiny": {
        "hidden": 32, "layers": 2, "heads": 2, "feed_forward": 64, "state_width": 64, "action_width": 8,
        "updates": 600, "warm_up": 50, "stretches": 16, "stretch": 50, "windows": 256, "check_every": 100,
        "averaging": 0.98, "minutes": 5.0,
    },
}  # fmt: skip
Configs = tuple[PredictorConfig, TrainingConfig]


def changed(configs: Configs, changes: Mapping[str, Any], source: str) -> Configs:
    """Both configs with some settings changed. Raises ConfigError naming `source`, for an unknown key or a wrong
    value."""
    settings = [asdict(config) for config in configs]
    for key, value in changes.items():
        owner = next((own for own in settings if key in own), None)
        if owner is None:
            known = ", ".join(field.name for config in configs for field in fields(config))
            raise ConfigError(f"{source}: unknown key {key!r}. Known: {known}.")
        owner[key] = _of_kind(type(owner[key]), value, f"{source}: {key}")
    return PredictorConfig(**settings[0]), TrainingConfig(**settings[1])


def parsed_changes(words: Sequence[str]) -> dict[str, str]:
    """`key=value` words of a command line. Raises ConfigError."""
    pairs = [word.partition("=") for word in words]
    for key, equals, _ in pairs:
        if not equals:
            raise ConfigError(f"--set {key}: write it as key=value, e.g. --set updates=2000")
    return {key.strip(): value.strip() for key, _, value in pairs}


def _of_kind(kind: Any, value: Any, place: str) -> Any:
    """`value` as `kind`; texts are read."""
    try:
        if isinstance(value, str) and kind is not str:
            value = {"true": True, "false": False}[value.lower()] if kind is bool else kind(value.replace("_", ""))
        if kind is float and type(value) is int:
            value = float(value)
    except (ValueError, KeyError):
        pass
    if type(value) is not kind or (kind in (int, float) and value < 0):
        raise ConfigError(f"{place} is {value!r}. Write a value of type {kind.__name__}, not negative.")
    return value
