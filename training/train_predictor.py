"""The predictor's training loop: cross-entropy summed over the steps, AdamW, averaged weights, early stopping on
validation.

Resumable to the step.
"""

import copy
import math
import time
from collections.abc import Callable, Mapping
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import torch
from torch import Tensor
from torch.nn import functional

from models.networks.checkpoint import load_checkpoint
from models.networks.config import PredictorConfig
from models.networks.policy import CnnPolicy, load_network
from models.networks.predictor import PredictorNetwork, predictor_network
from models.protocols import STEPS
from overcooked.constants import ACTIONS
from overcooked.layout import Layout
from training.collect import TRAIN, VALIDATION
from training.compute import Compute, autocast, quickest, requested
from training.dataset import NONE, Episodes, load_episodes, stream_batch, window_batch
from training.evaluate_predictor import Evaluation, evaluate, fitted_temperature, logits
from training.predictor_config import TrainingConfig
from training.runlog import RunFolder

Progress = Callable[[float, Mapping[str, float]], None]
LOOK_IS_NEAR_S = 10.0  # when the time is up, a validation that is due this soon is still made


class PredictorTrainer:
    """The training state of a predictor: network, its average, optimiser, the best weights so far."""

    def __init__(
        self,
        network: PredictorNetwork,
        config: TrainingConfig,
        train: Episodes,
        validation: Episodes,
        compute: Compute | None = None,  # None: the fastest, measured at the first update
    ) -> None:
        self.device = compute.device if compute else requested().chosen_device()
        self.network, self.config, self._compute = network.to(self.device), config, compute
        self.train, self.validation = train, validation
        self._labels = np.concatenate([train.labels(), train.partner_labels()], -1)  # (E, T, 6)
        self._of_partner = copy.deepcopy(self.network.decoder)
        learning = (*network.parameters(), *self._of_partner.parameters())
        self._optimiser = torch.optim.AdamW(
            [parameter for parameter in learning if parameter.requires_grad],
            config.learning_rate, (0.9, 0.98), weight_decay=config.weight_decay,
        )  # fmt: skip
        self.average = {name: value.clone() for name, value in self._learned().items()}
        self.best = {name: value.clone() for name, value in self.average.items()}
        self.best_accuracy, self.looks_since_best, self.update = 0.0, 0, 0
        self.measured: dict[str, float] = {}  # milliseconds of each candidate

    @property
    def compute(self) -> Compute:
        """Return how updates are computed. The measurement does not affect the run."""
        if self._compute is None:
            self._compute, self.measured = self._choose_compute()
        return self._compute

    def _choose_compute(self) -> tuple[Compute, dict[str, float]]:
        candidates = [Compute(self.device, precision, "direct") for precision in requested().precisions(self.device)]
        if len(candidates) == 1:
            return candidates[0], {}
        with torch.random.fork_rng(devices=[self.device] if self.device == "cuda" else []):
            self.network.train()
            chosen = quickest(candidates, lambda one: partial(self._learn_once, one), self.device)
        self._optimiser.zero_grad(set_to_none=True)
        return chosen

    def _learn_once(self, compute: Compute) -> Tensor:
        """Do the forward and backward pass of the next update; return its loss."""
        with autocast(compute.device, compute.precision):
            loss = self._loss(np.random.default_rng([self.config.seed, self.update]))
        self._optimiser.zero_grad(set_to_none=True)
        loss.backward()  # type: ignore[no-untyped-call]
        return loss.detach()

    def step(self) -> float:
        """Make one update; return its loss."""
        config = self.config
        share = max(0.0, (self.update - config.warm_up) / max(1, config.updates - config.warm_up))
        warm = min(1.0, (self.update + 1) / config.warm_up)
        rate = config.learning_rate * warm * (0.01 + 0.99 * (1 + math.cos(math.pi * min(1.0, share))) / 2)
        for group in self._optimiser.param_groups:
            group["lr"] = rate
        compute = self.compute
        self.network.train()
        loss = self._learn_once(compute)
        torch.nn.utils.clip_grad_norm_(self.network.parameters(), config.max_grad_norm)
        self._optimiser.step()
        self.update += 1
        keep = min(config.ema_decay, self.update / (self.update + 10))
        with torch.no_grad():
            for name, value in self._learned().items():
                self.average[name].lerp_(value, 1 - keep)
        return float(loss)

    def _loss(self, draws: np.random.Generator) -> Tensor:
        config, timesteps = self.config, self.train.own.shape[1]
        if self.network.config.form == "stream":
            length = min(config.stretch, timesteps)
            chosen = draws.integers(len(self.train), size=config.stretches)
            first = draws.integers(timesteps - length + 1, size=config.stretches)
            batch = stream_batch(self.train, self._labels, chosen, first, length)
            features, actions, labels = (part.to(self.device) for part in batch)
            tokens = self.network.tokens(features, actions)
        else:
            chosen = draws.integers(len(self.train), size=config.windows)
            last = draws.integers(timesteps, size=config.windows)
            windows = window_batch(self.train, self._labels, chosen, last)
            features, actions, present, labels = (part.to(self.device) for part in windows)
            tokens = self.network.tokens(features, actions, present)
        own, partner = labels[..., :STEPS], labels[..., STEPS:]
        loss = _cross_entropy(self.network.decode(tokens), own)
        if config.partner_weight:
            loss = loss + config.partner_weight * _cross_entropy(self._of_partner(self.network.norm(tokens)), partner)
        return loss

    def validate(self) -> Evaluation:
        """Validate the averaged weights and remember them if they are the best."""
        current = {name: value.clone() for name, value in self._learned().items()}
        self._load(self.average)
        with autocast(self.compute.device, self.compute.precision):
            result = evaluate(self.network, self.validation)
        self._load(current)
        if result.accuracy.mean > self.best_accuracy:
            self.best = {name: value.clone() for name, value in self.average.items()}
            self.best_accuracy, self.looks_since_best = result.accuracy.mean, 0
        else:
            self.looks_since_best += 1
        return result

    def finished(self) -> bool:
        return self.update >= self.config.updates or self.looks_since_best >= self.config.patience

    def use_best(self) -> None:
        """Load the best weights into the network, and calibrate it on validation."""
        self._load(self.best)
        logit_values = logits(self.network, self.validation) * self.network.temperature.cpu()[:, None]
        self.network.temperature.copy_(fitted_temperature(logit_values, torch.from_numpy(self.validation.labels())))

    def state(self) -> tuple[dict[str, Tensor], dict[str, Any]]:
        """Return everything that determines how training continues, for a run folder."""
        aside = {name: value.detach() for name, value in self._of_partner.named_parameters()}
        kept = {"now": self._learned(), "average": self.average, "best": self.best, "partner": aside}
        tensors = {f"{group}.{name}": value for group, values in kept.items() for name, value in values.items()}
        tensors["random."] = torch.get_rng_state()
        for index, moments in self._optimiser.state_dict()["state"].items():
            tensors.update({f"adam.{index}.{name}": value for name, value in moments.items()})
        numbers = {
            "timesteps": self.update, "best_accuracy": self.best_accuracy, "looks_since_best": self.looks_since_best
        }  # fmt: skip
        return tensors, numbers

    def restore(self, tensors: dict[str, Tensor], numbers: dict[str, Any]) -> None:
        """Continue from a `state`."""
        names = ("now", "average", "best", "partner", "adam", "random")
        groups: dict[str, dict[str, Tensor]] = {name: {} for name in names}
        for full, value in tensors.items():
            group, _, name = full.partition(".")
            groups[group][name] = value if group == "random" else value.to(self.device)
        torch.set_rng_state(groups["random"][""])
        self._load(groups["now"])
        self._of_partner.load_state_dict(groups["partner"])
        self.average, self.best = groups["average"], groups["best"]
        settings = self._optimiser.state_dict()
        moments: dict[int, dict[str, Tensor]] = {}
        for full, value in groups["adam"].items():
            index, _, name = full.partition(".")
            moments.setdefault(int(index), {})[name] = value
        self._optimiser.load_state_dict({**settings, "state": moments})
        self.update = int(numbers["timesteps"])
        self.best_accuracy, self.looks_since_best = numbers["best_accuracy"], numbers["looks_since_best"]

    def _learned(self) -> dict[str, Tensor]:
        return {name: value.detach() for name, value in self.network.named_parameters() if value.requires_grad}

    @torch.no_grad()
    def _load(self, values: Mapping[str, Tensor]) -> None:
        for name, value in self.network.named_parameters():
            if name in values:
                value.copy_(values[name])


def _cross_entropy(logit_values: Tensor, labels: Tensor) -> Tensor:
    """Return the cross-entropy summed over the three steps: logits (..., 3, 6), labels (..., 3)."""
    return functional.cross_entropy(logit_values.float().view(-1, ACTIONS), labels.flatten(), ignore_index=NONE) * STEPS


def prepared(
    layout: Layout,
    network: PredictorConfig,
    config: TrainingConfig,
    games: Path,
    encoder_from: Path | None = None,
    begin_with: Path | None = None,
) -> PredictorTrainer:
    """Return a trainer with its games loaded. `encoder_from`: the agent whose convolutions a CNN encoder has.
    `begin_with`: a predictor of the same kitchen and shape to start from. Raises ValueError or OSError if one of them
    cannot be used."""
    torch.manual_seed(config.seed)
    model = PredictorNetwork(layout, network)
    if begin_with is not None:
        _take_weights(model, begin_with)
    if model.encoder.convolutions is not None:
        if encoder_from is None:
            raise ValueError("encoder = cnn: name the agent whose convolutions it has, --encoder-from FOLDER.")
        agent = load_network(encoder_from)
        if not isinstance(agent, CnnPolicy):
            raise ValueError(f"{encoder_from}: has no convolutions. Give an agent trained with network = cnn.")
        model.encoder.convolutions.load_state_dict(agent.features.state_dict())
    episodes = [load_episodes(games, split, layout, model.encoder) for split in (TRAIN, VALIDATION)]
    return PredictorTrainer(model, config, episodes[0], episodes[1])


def _take_weights(model: PredictorNetwork, folder: Path) -> None:
    other, _ = predictor_network(load_checkpoint(folder))
    try:
        other.intentions = None  # it was trained on the tokens of the other predictor
        model.load_state_dict(other.state_dict())
    except RuntimeError as error:
        raise ValueError(
            f"{folder}: is for another kitchen or of another shape ({error}). Begin without it."
        ) from error
    model.temperature.fill_(1.0)


def train_predictor(trainer: PredictorTrainer, folder: RunFolder, progress: Progress | None = None) -> PredictorNetwork:
    """Train until validation no longer improves (or continue an interrupted run); return the calibrated best network.
    Raises TimeoutError if the config's `minutes` are over first: the next call continues, and `usable` returns the best
    network so far.
    """
    torch.set_num_threads(1)
    state = folder.load()
    if state is not None:
        trainer.restore(*state)
    folder.note_compute(str(trainer.compute), trainer.measured)
    began, first = time.monotonic(), trainer.update
    finish = began + 60 * trainer.config.minutes
    over = f"{folder.path}: {trainer.config.minutes:g} minutes are over; the same command continues."
    losses: list[float] = []
    while not trainer.finished():
        losses.append(trainer.step())
        pace_s = (time.monotonic() - began) / (trainer.update - first)
        if progress and trainer.update - first == 5:
            progress(trainer.update / trainer.config.updates, {"accuracy": trainer.best_accuracy, "pace_s": pace_s})
        if trainer.update % trainer.config.check_every and trainer.update < trainer.config.updates:
            until_look_s = pace_s * (trainer.config.check_every - trainer.update % trainer.config.check_every)
            if time.monotonic() > finish and until_look_s > LOOK_IS_NEAR_S:
                folder.save(*trainer.state())
                raise TimeoutError(over)
            continue
        result = trainer.validate()
        line = {
            "timesteps": trainer.update, "loss": float(np.mean(losses)), "validation_loss": result.loss,
            "accuracy": result.accuracy.mean, **{f"step{k + 1}": v for k, v in enumerate(result.accuracy.steps)},
        }  # fmt: skip
        losses.clear()
        folder.log(line)
        folder.save(*trainer.state())
        if progress:
            progress(trainer.update / trainer.config.updates, line)
        if time.monotonic() > finish and not trainer.finished():
            raise TimeoutError(over)
    trainer.use_best()
    return trainer.network


def usable(trainer: PredictorTrainer) -> PredictorNetwork:
    """Return the calibrated best network so far of a training that was stopped. Do not continue to train it."""
    if not trainer.best_accuracy:  # no validation was made yet
        trainer.validate()
    trainer.use_best()
    return trainer.network
