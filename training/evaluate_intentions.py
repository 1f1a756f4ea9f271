"""Measure how well a predictor predicts an agent's next interaction, next to two baselines that need no predictor."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
import torch
from numpy.typing import NDArray

from models.networks.predictor import PredictorNetwork
from overcooked.interactions import possible_interactions
from overcooked.layout import Layout
from training.collect import Shard, whole_episodes
from training.dataset import episodes_of
from training.evaluate_predictor import calibration_error, over_all_states
from training.intention_baselines import FrequentNext, nearest_sensible
from training.intention_labels import NOTHING_HAPPENS, UNKNOWN, labels_of

BEFORE: Final = (5, 10, 20)  # timesteps before an interaction is done: 1, 2 and 4 seconds
_HALF: Final = 0.5
Places = NDArray[np.int64]  # in `possible_interactions(layout)`


@dataclass(frozen=True)
class EvaluatedIntentions:
    """A predictor's intentions in N states, the actual next interaction, and the baselines in those states that are
    `BEFORE`."""

    predicted: Places
    second: Places  # the runner-up
    probability: NDArray[np.float32]
    when: NDArray[np.int64]  # the predicted number of timesteps
    classes: Places  # what came
    steps: NDArray[np.int64]
    frequent: Places
    nearest: Places  # UNKNOWN where it was not asked


def predicted_intentions(
    network: PredictorNetwork, shards: Sequence[Shard], layout: Layout, frequent: FrequentNext
) -> EvaluatedIntentions:
    """Return the predictions of the network's decoder of intentions for every state whose next interaction is known."""
    parts = [_of_shard(network, shard, layout, frequent) for shard in shards]
    return EvaluatedIntentions(
        *(np.concatenate([getattr(part, name) for part in parts]) for name in EvaluatedIntentions.__dataclass_fields__)
    )


def _of_shard(network: PredictorNetwork, shard: Shard, layout: Layout, frequent: FrequentNext) -> EvaluatedIntentions:
    shard = whole_episodes(shard)
    labels = labels_of(shard, layout)
    tokens = over_all_states(network, episodes_of(shard, layout, network.encoder), network.tokens_of_all_layers)
    known = labels.classes != UNKNOWN
    asked = np.isin(labels.steps, BEFORE) & known
    nearest = np.full(labels.classes.shape, UNKNOWN)
    shape = shard["timestep"].shape
    nearest[asked] = nearest_sensible(shard, layout, asked.reshape(shape))
    likeliest, probability, when = _decoded(network, tokens[torch.from_numpy(known)])
    return EvaluatedIntentions(
        predicted=likeliest[:, 0],
        second=likeliest[:, 1],
        probability=probability,
        when=when,
        classes=labels.classes[known],
        steps=labels.steps[known],
        frequent=frequent(shard).reshape(labels.classes.shape)[known],
        nearest=nearest[known],
    )


@torch.inference_mode()
def _decoded(network: PredictorNetwork, tokens: torch.Tensor) -> tuple[Places, NDArray[np.float32], NDArray[np.int64]]:
    """Return the two most likely classes (N, 2), the probability of the first and the median timesteps until it is
    done."""
    decoder = network.intentions
    if decoder is None:
        raise ValueError("this predictor has no intentions. Add a decoder: kitchenmind train intentions.")
    inside = decoder.inside(tokens.float())
    top = decoder.class_logits(inside).softmax(-1).topk(2, -1)
    when = 1 + (decoder.when_logits(inside, top.indices[:, 0]).softmax(-1).cumsum(-1) < _HALF).sum(-1)
    return top.indices.numpy(), top.values[:, 0].numpy(), when.numpy()


def intention_entry(found: EvaluatedIntentions, layout: Layout) -> dict[str, Any]:
    """Return the figures as JSON values: shares in %, by timesteps before the interaction is done, and over all
    states."""
    kinds = np.array([interaction.kind for interaction in possible_interactions(layout)])
    right, something = found.predicted == found.classes, found.classes != NOTHING_HAPPENS
    both = right & something
    before = {}
    for timesteps in BEFORE:
        these = found.steps == timesteps
        before[str(timesteps)] = {
            "states": int(these.sum()),
            "kind": _percent(kinds[found.predicted] == kinds[found.classes], these),
            "kind_and_station": _percent(right, these),
            "first_two": _percent(right | (found.second == found.classes), these),
            "nearest_sensible": _percent(found.nearest == found.classes, these),
            "frequent": _percent(found.frequent == found.classes, these),
            "when_error": _mean(np.abs(found.when - found.steps), both & these),
        }
    return {
        "before": before,
        "all_states": _percent(right, np.ones_like(right)),
        "none": _percent(right, ~something),
        "none_share": _percent(~something, np.ones_like(right)),
        "frequent": _percent(found.frequent == found.classes, np.ones_like(right)),
        "ece": round(calibration_error(found.probability, right), 4),
        "when_error": _mean(np.abs(found.when - found.steps), both),
        "states": len(right),
    }


def _percent(which: NDArray[np.bool_], of: NDArray[np.bool_]) -> float | None:
    return round(100 * float(which[of].mean()), 2) if of.any() else None


def _mean(values: NDArray[np.int64], of: NDArray[np.bool_]) -> float | None:
    return round(float(values[of].mean()), 2) if of.any() else None
