"""Turn collected games into a predictor's inputs and labels: cached features, joint actions, the next three actions."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import torch
from numpy.typing import NDArray

from models.networks.predictor import JOINT, Encoder, one_hot
from models.protocols import HISTORY, STEPS
from overcooked.constants import HORIZON, PLAYERS
from overcooked.layout import Layout
from overcooked.state import Kitchens
from training.collect import Shard, read_manifest, read_shard

NONE = -1  # a label beyond the end of an episode
_AT_ONCE = 20_000  # states that go through the encoder together


@dataclass(frozen=True)
class Episodes:
    """E episodes of one kitchen, each of T timesteps."""

    features: torch.Tensor  # (E, T, size) float16: the encoder's features of each state as the target sees it
    before: NDArray[np.int8]  # (E, T, 2): the joint action that led to the state, target first; -1 at the start
    own: NDArray[np.int8]  # (E, T): the action taken in the state
    certainty: NDArray[np.float32]  # (E, T): the largest probability of that action's distribution
    stuck: NDArray[np.int16]  # (E, T, 2): timesteps since a chef's cell, facing or hand changed, target first

    def __len__(self) -> int:
        return len(self.own)

    def labels(self) -> NDArray[np.int64]:
        """Return the target's next actions, (E, T, 3), starting with the one in the state; NONE beyond the end."""
        return _coming(self.own)

    def partner_labels(self) -> NDArray[np.int64]:
        """Return the partner's next actions in the same form, derived from the next state."""
        partner = np.full_like(self.own, NONE)
        partner[:, :-1] = self.before[:, 1:, 1]
        return _coming(partner)


def _coming(actions: NDArray[np.int8]) -> NDArray[np.int64]:
    """Map actions (E, T) to the next three of each timestep, (E, T, 3)."""
    labels = np.full((*actions.shape, STEPS), NONE, np.int64)
    for step in range(STEPS):
        labels[:, : actions.shape[1] - step, step] = actions[:, step:]
    return labels


def load_episodes(folder: Path, split: str, layout: Layout, encoder: Encoder) -> Episodes:
    """Load all collected games of a split. Raises ValueError if there are none."""
    shards = {name: facts for name, facts in read_manifest(folder)["shards"].items() if facts["split"] == split}
    if not shards:
        raise ValueError(f"{folder}: no partner is kept for {split}. Collect with at least 3 partner agents.")
    return joined(
        [episodes_of(read_shard(folder, name, facts["sha256"]), layout, encoder) for name, facts in shards.items()]
    )


def joined(parts: Sequence[Episodes]) -> Episodes:
    """Concatenate episodes."""
    return Episodes(
        torch.cat([part.features for part in parts]),
        *(np.concatenate([getattr(part, name) for part in parts]) for name in ("before", "own", "certainty", "stuck")),
    )


def episodes_of(shard: Shard, layout: Layout, encoder: Encoder) -> Episodes:
    """Cut one partner's games into episodes."""
    timesteps = min(HORIZON, shard["timestep"].shape[1])
    episodes = shard["timestep"].shape[1] // timesteps
    cut = {
        name: values[:, : episodes * timesteps].reshape(-1, timesteps, *values.shape[2:])
        for name, values in shard.items()
        if name != "seat"
    }
    seat = np.repeat(shard["seat"], episodes)
    before = np.full(cut["actions"].shape, NONE, np.int8)
    before[:, 1:] = cut["actions"][:, :-1]
    certainty = cut["law"].max(-1).astype(np.float32)
    return Episodes(_features(cut, seat, layout, encoder), before, cut["actions"][..., 0], certainty, cut["stuck"])


@torch.inference_mode()
def _features(cut: Shard, seat: NDArray[np.int8], layout: Layout, encoder: Encoder) -> torch.Tensor:
    """Return the encoder's features, (E, T, size) float16."""
    episodes, timesteps = cut["timestep"].shape
    seats = np.repeat(seat, timesteps)
    players = cut["players"].reshape(-1, PLAYERS, 4)
    contents = cut["contents"].reshape(-1, layout.width, layout.height)
    clock = cut["timestep"].reshape(-1).astype(np.int32)
    device = next(iter([*encoder.parameters(), *encoder.buffers()])).device
    parts = []
    for first in range(0, len(clock), _AT_ONCE):
        some = slice(first, first + _AT_ONCE)
        kitchens = Kitchens(layout, players[some].copy(), contents[some].copy(), clock[some])
        seen = kitchens.encode()[np.arange(kitchens.games), seats[some]]
        parts.append(encoder(torch.from_numpy(seen).to(device)).half().cpu())
    return torch.cat(parts).view(episodes, timesteps, -1)


def stream_batch(
    episodes: Episodes, labels: NDArray[np.int64], chosen: NDArray[np.intp], first: NDArray[np.intp], timesteps: int
) -> tuple[torch.Tensor, torch.Tensor, torch.Tensor]:
    """Stretches of `timesteps` from `first` on: features (B, T, size), actions (B, T, 12), labels (B, T, ...)."""
    rows, columns = chosen[:, None], first[:, None] + np.arange(timesteps)
    features = episodes.features[torch.from_numpy(rows), torch.from_numpy(columns)].float()
    actions = torch.from_numpy(one_hot(episodes.before[rows, columns]))
    return features, actions, torch.from_numpy(labels[rows, columns])


def window_batch(
    episodes: Episodes, labels: NDArray[np.int64], chosen: NDArray[np.intp], last: NDArray[np.intp]
) -> tuple[torch.Tensor, torch.Tensor, torch.Tensor, torch.Tensor]:
    """Windows of ten that end with `last`: features (B, 10, size), actions (B, 10, 12) with the current one zero, which
    steps are within the game (B, 10), labels (B, ...)."""
    columns = last[:, None] + np.arange(1 - HISTORY, 1)
    present = columns >= 0
    rows, columns = chosen[:, None], np.maximum(columns, 0)
    features = episodes.features[torch.from_numpy(rows), torch.from_numpy(columns)].float()
    features = features * torch.from_numpy(present)[..., None]
    actions = np.zeros((len(chosen), HISTORY, JOINT), np.float32)
    taken = np.where(present[:, :-1, None], episodes.before[rows, columns][:, 1:], NONE)
    actions[:, :-1] = one_hot(taken)
    return features, torch.from_numpy(actions), torch.from_numpy(present), torch.from_numpy(labels[chosen, last])
