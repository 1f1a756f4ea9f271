"""Measure a predictor: accuracy by step, next to the ceiling and to baselines without a model."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray

from models.networks.predictor import PredictorNetwork
from models.protocols import STEPS
from overcooked.constants import ACTIONS
from training.dataset import NONE, Episodes, stream_batch, window_batch

STUCK_AFTER = 3  # timesteps without a change of cell, facing or hand: a tick counts as stuck, for people and agents
BINS = 15  # of the confidence, for the calibration error
_AT_ONCE = {"stream": 16, "window": 4096}  # episodes, windows
_WINDOWS_ON_CPU = 512  # few enough for the caches of a core


@dataclass(frozen=True)
class OfflineAccuracy:
    """Shares of right actions."""

    steps: tuple[float, ...]  # by predicted step

    @property
    def mean(self) -> float:
        return sum(self.steps) / len(self.steps)


@dataclass(frozen=True)
class Evaluation:
    """The figures of one predictor on one set of games."""

    accuracy: OfflineAccuracy
    repeat: OfflineAccuracy  # baseline: the target's last action, three times
    frequent: OfflineAccuracy  # baseline: the action that it takes most
    ceiling: float  # of step 1: mean of the largest probability of the target's action distribution
    free: OfflineAccuracy  # where nobody was stuck
    free_repeat: OfflineAccuracy
    free_frequent: OfflineAccuracy
    free_share: float
    error: float  # expected calibration error of the top probability, all steps together
    loss: float  # cross-entropy summed over the steps
    windows: int

    def entry(self, layout: str, agent: str, form: str) -> dict[str, Any]:
        """As `kitchenmind evaluate predictor --json` prints it."""
        steps = {f"step{k + 1}": round(100 * share, 2) for k, share in enumerate(self.accuracy.steps)}
        return {
            "layout": layout,
            "agent": agent,
            "form": form,
            "accuracy": {**steps, "mean": round(100 * self.accuracy.mean, 2)},
            "ceiling_step1": round(100 * self.ceiling, 2),
            "baselines": {"repeat": round(100 * self.repeat.mean, 2), "frequent": round(100 * self.frequent.mean, 2)},
            "not_stuck": {"mean": round(100 * self.free.mean, 2)},
            "ece": round(self.error, 4),
            "windows": self.windows,
        }


def logits(network: PredictorNetwork, episodes: Episodes) -> torch.Tensor:
    """Return the network's logits for every state: (E, T, 3, 6), by its forward pass in training; serving gives the
    same."""
    return over_all_states(network, episodes, network).float()


@torch.inference_mode()
def over_all_states(network: PredictorNetwork, episodes: Episodes, answer: Callable[..., torch.Tensor]) -> torch.Tensor:
    """Apply `answer`, one of the network's functions of features, actions and (window form) presence, to every state:
    (E, T, ...)."""
    network.eval()
    device = network.temperature.device
    labels, timesteps = episodes.labels(), episodes.own.shape[1]
    every = np.arange(len(episodes))
    if network.config.form == "stream":
        parts = []
        for first in range(0, len(every), _AT_ONCE["stream"]):
            chosen = every[first : first + _AT_ONCE["stream"]]
            features, actions, _ = stream_batch(episodes, labels, chosen, np.zeros_like(chosen), timesteps)
            parts.append(answer(features.to(device), actions.to(device)).cpu())
        return torch.cat(parts)
    rows, last = (each.ravel() for each in np.meshgrid(every, np.arange(timesteps), indexing="ij"))
    parts = []
    at_once = _WINDOWS_ON_CPU if device.type == "cpu" else _AT_ONCE["window"]
    for first in range(0, len(rows), at_once):
        some = slice(first, first + at_once)
        features, actions, present, _ = window_batch(episodes, labels, rows[some], last[some])
        parts.append(answer(*(part.to(device) for part in (features, actions, present))).cpu())
    logit_values = torch.cat(parts)
    return logit_values.view(len(every), timesteps, *logit_values.shape[1:])


def evaluate(network: PredictorNetwork, episodes: Episodes, frequent_action: int | None = None) -> Evaluation:
    """`frequent_action`: the target's most frequent one in training; None: in these games (which flatters the
    baseline)."""
    logit_values, labels = logits(network, episodes), torch.from_numpy(episodes.labels())
    known = labels != NONE
    right = (logit_values.argmax(-1) == labels) & known
    repeated = torch.from_numpy(np.maximum(episodes.before[..., :1], 0).astype(np.int64))
    if frequent_action is None:
        frequent_action = int(np.bincount(episodes.own.ravel(), minlength=ACTIONS).argmax())
    frequent = (labels == frequent_action) & known
    repeat = (labels == repeated) & known
    free = torch.from_numpy((episodes.stuck < STUCK_AFTER).all(-1))[..., None] & known
    top = logit_values.softmax(-1).amax(-1)
    loss = torch.nn.functional.cross_entropy(logit_values.flatten(0, 2), labels.flatten(), ignore_index=NONE)
    return Evaluation(
        accuracy=_share(right, known),
        repeat=_share(repeat, known),
        frequent=_share(frequent, known),
        ceiling=float(episodes.certainty.mean()),
        free=_share(right & free, free),
        free_repeat=_share(repeat & free, free),
        free_frequent=_share(frequent & free, free),
        free_share=float(free.sum() / known.sum()),
        error=calibration_error(top[known].numpy(), right[known].numpy()),
        loss=float(loss) * STEPS,
        windows=int(known[..., 0].sum()),
    )


def calibration_error(confidence: NDArray[np.floating[Any]], right: NDArray[np.bool_]) -> float:
    """Return the expected calibration error: how far confidence and accuracy are apart, over bins of equal width."""
    bins = np.minimum((confidence * BINS).astype(int), BINS - 1)
    counts = np.bincount(bins, minlength=BINS)
    gaps = np.abs(np.bincount(bins, confidence, BINS) - np.bincount(bins, right, BINS))
    return float(gaps.sum() / counts.sum())


def fitted_temperature(logit_values: torch.Tensor, labels: torch.Tensor) -> torch.Tensor:
    """Return (STEPS,): the divisors of the logits (E, T, 3, 6) that maximise the likelihood of the labels. [temperature
    scaling]"""
    candidates = torch.logspace(-0.5, 0.7, 61)
    chosen = []
    for step in range(STEPS):
        known = labels[..., step] != NONE
        own, wanted = logit_values[..., step, :][known], labels[..., step][known]
        losses = [float(torch.nn.functional.cross_entropy(own / candidate, wanted)) for candidate in candidates]
        chosen.append(candidates[int(np.argmin(losses))])
    return torch.stack(chosen)


def _share(right: torch.Tensor, of: torch.Tensor) -> OfflineAccuracy:
    counts = of.flatten(0, 1).sum(0).clamp(min=1)
    return OfflineAccuracy(tuple((right.flatten(0, 1).sum(0) / counts).tolist()))
