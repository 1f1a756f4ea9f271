"""The settings of a predictor: of its network and of its training. `--set`, presets and stored runs change them."""

from collections.abc import Mapping
from dataclasses import asdict
from typing import Any, Literal, Self

from pydantic import Field, model_validator

from models.networks.config import IntentionConfig, PredictorConfig
from training.settings import TrainingSettings


class NetworkSettings(TrainingSettings):
    """The transformer (`models.networks.config.PredictorConfig`, which is frozen with the weights)."""

    form: Literal["stream", "window"] = Field(
        "stream", description="stream: causal attention over the whole game; window: the paper's last 10 timesteps."
    )
    encoder: Literal["columns", "cnn"] = Field(
        "columns",
        serialization_alias="eyes",
        description="columns: the entries of the encoding that can change; cnn: an agent's frozen convolutions.",
    )
    filters: int = Field(PredictorConfig.filters, ge=1, description="Filters of each convolution (`cnn` only).")
    hidden: int = Field(PredictorConfig.hidden, ge=2, description="Width of a token.")
    layers: int = Field(PredictorConfig.layers, ge=1, description="Number of transformer layers.")
    heads: int = Field(PredictorConfig.heads, ge=1, description="Attention heads of each layer.")
    feed_forward: int = Field(PredictorConfig.feed_forward, ge=1, description="Width of a layer's feed-forward part.")
    state_width: int = Field(PredictorConfig.state_width, ge=1, description="Width of an encoded state in a token.")
    action_width: int = Field(PredictorConfig.action_width, ge=1, description="Width of an embedded joint action.")
    attention_window: int = Field(
        PredictorConfig.look_back,
        ge=1,
        serialization_alias="look_back",
        description="stream: timesteps that a layer attends to, including the current one.",
    )
    dropout: float = Field(PredictorConfig.dropout, ge=0, lt=1, description="Dropout during training.")

    @model_validator(mode="after")
    def _heads_share_the_width(self) -> Self:
        if self.hidden % (2 * self.heads):
            raise ValueError(f"hidden is {self.hidden}. Write a multiple of {2 * self.heads} (twice the heads).")
        return self


class TrainingConfig(TrainingSettings):
    """How a predictor learns."""

    updates: int = Field(6000, ge=1, description="Maximum number of updates.")
    learning_rate: float = Field(
        1e-3, ge=0, description="Learning rate of AdamW; it warms up, then falls along a cosine to a hundredth."
    )
    warm_up: int = Field(100, ge=1, description="Updates over which the learning rate rises from zero.")
    stretches: int = Field(24, ge=1, description="stream: sequences of timesteps in an update.")
    stretch: int = Field(100, ge=1, description="stream: timesteps of a sequence.")
    windows: int = Field(512, ge=1, description="window: windows in an update.")
    partner_weight: float = Field(
        0.0, ge=0, description="Weight of also predicting the partner, by a decoder that is not stored."
    )
    weight_decay: float = Field(0.02, ge=0, description="Weight decay of AdamW.")
    max_grad_norm: float = Field(
        1.0,
        ge=0,
        serialization_alias="gradient_norm",
        description="Gradients with a larger norm are scaled down to it.",
    )
    ema_decay: float = Field(
        0.998,
        ge=0,
        lt=1,
        serialization_alias="averaging",
        description="Decay of the exponential moving average of the weights, which is what is stored.",
    )
    check_every: int = Field(250, ge=1, description="Updates between two validations.")
    patience: int = Field(8, ge=1, description="Validations without improvement before training stops.")
    minutes: float = Field(15.0, ge=0, description="Maximum minutes of one call; the same command continues later.")
    seed: int = Field(0, ge=0, description="Random seed.")


class IntentionSettings(TrainingSettings):
    """How a predictor's decoder of intentions learns; nothing else of the predictor changes."""

    hidden: int = Field(IntentionConfig.hidden, ge=1, description="Width between the tokens and the interactions.")
    when_hidden: int = Field(IntentionConfig.when_hidden, ge=1, description="Width before the timesteps.")
    states: int = Field(
        300_000, ge=1000, description="Maximum number of states to learn from, evenly from all partners."
    )
    updates: int = Field(2000, ge=1, description="Number of updates; the best of the validations is kept.")
    batch: int = Field(1024, ge=1, description="States in an update.")
    learning_rate: float = Field(
        2e-3, ge=0, description="Learning rate of AdamW; it warms up, then falls along a cosine to a hundredth."
    )
    warm_up: int = Field(50, ge=1, description="Updates over which the learning rate rises from zero.")
    weight_decay: float = Field(0.01, ge=0, description="Weight decay of AdamW.")
    when_weight: float = Field(0.5, ge=0, description="Weight of the timesteps in the loss, next to the interactions.")
    check_every: int = Field(250, ge=1, description="Updates between two validations.")
    seed: int = Field(0, ge=0, description="Random seed.")


class PredictorTrainingSettings(TrainingConfig, NetworkSettings):
    """Everything that `kitchenmind train predictor --set` can change."""


# What `train predictor --preset` may name: settings other than the defaults.
PRESETS: Mapping[str, Mapping[str, Any]] = {
    "full": {},
    "tiny": {
        "hidden": 32, "layers": 2, "heads": 2, "feed_forward": 64, "state_width": 64, "action_width": 8,
        "updates": 600, "warm_up": 50, "stretches": 16, "stretch": 50, "windows": 256, "check_every": 100,
        "ema_decay": 0.98, "minutes": 5.0,
    },
}  # fmt: skip
# The same of the decoder of intentions.
INTENTION_PRESETS: Mapping[str, Mapping[str, Any]] = {
    "full": {},
    "tiny": {"hidden": 64, "when_hidden": 32, "states": 30_000, "updates": 400, "batch": 512, "check_every": 100},
}
Configs = tuple[PredictorConfig, TrainingConfig]


def changed(configs: Configs, changes: Mapping[str, Any], source: str) -> Configs:
    """Return both configs with some settings changed. Raises ConfigError naming `source`."""
    network, training = configs
    stored = {**asdict(network), **training.stored()}
    settings = PredictorTrainingSettings().changed(stored, source).changed(changes, source).stored()
    own = {name: settings[name] for name in asdict(network)}
    return PredictorConfig(**own), TrainingConfig().changed({key: settings[key] for key in training.stored()}, source)


def intention_settings(preset: str) -> IntentionSettings:
    """Return the settings with which the decoder of intentions learns in `train predictor --preset`."""
    return IntentionSettings().changed(INTENTION_PRESETS[preset], "--preset")
