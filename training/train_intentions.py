"""Train a decoder of intentions on the tokens of a frozen predictor.

The tokens are computed once; then only the decoder learns, by cross-entropy over the interactions that the kitchen
allows and over the timesteps until they are done. Validation chooses its weights and calibrates it.
"""

import copy
import math
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import torch
from torch import Tensor
from torch.nn import functional

from models.networks.config import IntentionConfig
from models.networks.intentions import IntentionDecoder
from models.networks.predictor import PredictorNetwork, intention_decoder
from models.protocols import INTENTION_HORIZON
from overcooked.layout import Layout
from training.collect import Shard, read_manifest, read_shard
from training.dataset import episodes_of
from training.evaluate_predictor import over_all_states
from training.intention_labels import NOTHING_HAPPENS, UNKNOWN, labels_of
from training.predictor_config import IntentionSettings

Progress = Callable[[float], None]
_TEMPERATURES = np.logspace(-0.5, 0.7, 61)


@dataclass(frozen=True)
class IntentionStates:
    """N states whose next interaction is known."""

    tokens: Tensor  # (N, layers * hidden) float16
    classes: Tensor  # (N,): places in `possible_interactions(layout)`
    steps: Tensor  # (N,): timesteps until it is done; 0 for none

    def __len__(self) -> int:
        return len(self.classes)


def read_shards(folder: Path, split: str, states: int | None = None) -> list[Shard]:
    """Read the collected games of a split; if they have more states than wanted, the same share of every partner's
    games. Raises ValueError if there are none."""
    found = {name: facts for name, facts in read_manifest(folder)["shards"].items() if facts["split"] == split}
    if not found:
        raise ValueError(f"{folder}: no partner is kept for {split}. Collect with at least 3 partner agents.")
    shards = [read_shard(folder, name, facts["sha256"]) for name, facts in found.items()]
    share = 1.0 if states is None else min(1.0, states / sum(shard["timestep"].size for shard in shards))
    return [_some_games(shard, share) for shard in shards]


def _some_games(shard: Shard, share: float) -> Shard:
    """Return a share of the games, evenly from all seats and settings."""
    games = len(shard["seat"])
    chosen = np.unique(np.linspace(0, games - 1, max(1, round(share * games))).round().astype(int))
    return {name: values[chosen] for name, values in shard.items()}


def states_of(shards: list[Shard], layout: Layout, network: PredictorNetwork) -> IntentionStates:
    """Return all states of these games whose next interaction is known, as tokens of the predictor's layers. Raises
    ValueError if there are none."""
    parts = []
    for shard in shards:
        labels = labels_of(shard, layout)
        tokens = over_all_states(network, episodes_of(shard, layout, network.encoder), network.tokens_of_all_layers)
        known = torch.from_numpy(labels.classes != UNKNOWN)
        parts.append(
            (tokens[known].half(), torch.from_numpy(labels.classes)[known], torch.from_numpy(labels.steps)[known])
        )
    states = IntentionStates(*(torch.cat(part) for part in zip(*parts, strict=True)))
    if not len(states):
        raise ValueError(
            f"games of {shards[0]['timestep'].shape[1]} timesteps are too short to see what comes within "
            f"{INTENTION_HORIZON}. Collect longer ones, or train with --no-intentions."
        )
    return states


def train_intentions(
    network: PredictorNetwork,
    layout: Layout,
    train: IntentionStates,
    validation: IntentionStates,
    settings: IntentionSettings,
    progress: Progress | None = None,
) -> IntentionDecoder:
    """Return a calibrated decoder for this predictor, the best on validation. The predictor itself does not change."""
    torch.manual_seed(settings.seed)
    config = IntentionConfig(settings.hidden, settings.when_hidden)
    decoder = intention_decoder(layout, network.config, config)
    optimiser = torch.optim.AdamW(decoder.parameters(), settings.learning_rate, weight_decay=settings.weight_decay)
    draws = np.random.default_rng(settings.seed)
    best, lowest = copy.deepcopy(decoder.state_dict()), math.inf
    for update in range(1, settings.updates + 1):
        share = max(0.0, (update - settings.warm_up) / max(1, settings.updates - settings.warm_up))
        rate = min(1.0, update / settings.warm_up) * (0.01 + 0.99 * (1 + math.cos(math.pi * share)) / 2)
        for group in optimiser.param_groups:
            group["lr"] = settings.learning_rate * rate
        chosen = torch.from_numpy(draws.integers(len(train), size=settings.batch))
        loss = _loss(decoder, train, chosen, settings.when_weight)
        optimiser.zero_grad(set_to_none=True)
        loss.backward()  # type: ignore[no-untyped-call]
        optimiser.step()
        if update % settings.check_every == 0 or update == settings.updates:
            of_validation = _validated(decoder, validation, settings.when_weight)
            if of_validation < lowest:
                best, lowest = copy.deepcopy(decoder.state_dict()), of_validation
            if progress:
                progress(update / settings.updates)
    decoder.load_state_dict(best)
    calibrate(decoder, validation)
    return decoder.eval()


def _loss(decoder: IntentionDecoder, states: IntentionStates, chosen: Tensor, when_weight: float) -> Tensor:
    classes, steps = states.classes[chosen], states.steps[chosen]
    inside = decoder.inside(states.tokens[chosen].float())
    loss = functional.cross_entropy(decoder.class_logits(inside), classes)
    done = classes != NOTHING_HAPPENS
    if when_weight and done.any():
        when = decoder.when_logits(inside[done], classes[done])
        loss = loss + when_weight * functional.cross_entropy(when, steps[done] - 1)
    return loss


@torch.inference_mode()
def _validated(decoder: IntentionDecoder, states: IntentionStates, when_weight: float) -> float:
    return float(_loss(decoder, states, torch.arange(len(states)), when_weight))


@torch.inference_mode()
def calibrate(decoder: IntentionDecoder, states: IntentionStates) -> None:
    """Set both temperatures to maximise the likelihood of what happened in these states. [temperature scaling]"""
    decoder.temperature.fill_(1.0)
    inside = decoder.inside(states.tokens.float())
    done = states.classes != NOTHING_HAPPENS
    when = decoder.when_logits(inside[done], states.classes[done])
    pairs = [(decoder.class_logits(inside), states.classes), (when, states.steps[done] - 1)]
    for number, (logits, wanted) in enumerate(pairs if done.any() else pairs[:1]):
        losses = [float(functional.cross_entropy(logits / candidate, wanted)) for candidate in _TEMPERATURES]
        decoder.temperature[number] = float(_TEMPERATURES[int(np.argmin(losses))])
