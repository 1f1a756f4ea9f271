"""Human-like partners: small networks that imitate the people in recorded games (behaviour cloning).

The recordings are Carroll et al.'s human-human games on the five classic layouts (tests/data). On each, the
behaviour-cloned human for measuring agents and predictors learns from the later half of the games, those for training
predictors from the earlier half: no game is in both. Run it as `python -m training.behaviour_cloning --layout NAME`.
"""

import argparse
import gzip
import json
from dataclasses import asdict, dataclass, replace
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray
from torch.nn import functional

from models.agents.catalogue import WEIGHTS
from models.networks.config import NetworkConfig
from models.networks.policy import MlpPolicy, build_network, save_agent
from models.protocols import Mode
from overcooked.layout import Layout, load_layout
from overcooked.state import Kitchens
from training.runlog import revision

RECORDED = {  # human-human games on each layout
    "cramped_room": 8,
    "asymmetric_advantages": 9,
    "coordination_ring": 8,
    "forced_coordination": 6,
    "counter_circuit": 8,
}
_DEFAULT = "coordination_ring"
_DATA = Path(__file__).parent.parent / "tests" / "data"
NAME = "human_bc"
# behaviour-cloned humans get stuck far more than people do
LIKE_PEOPLE = Mode(temperature=1.0, stuck_after=3, stuck_mix=0.5)
NETWORKS_OF_A_KIND = 3


@dataclass(frozen=True)
class CloningConfig:
    """How the network is trained."""

    games: tuple[int, ...]  # that it imitates; the last one only says when to stop
    hidden: tuple[int, ...] = (64, 64)
    epochs: int = 100  # at most
    minibatch: int = 256
    learning_rate: float = 1e-3
    weight_decay: float = 0.1
    noise: float = 0.1  # share of input entries that are hidden while training
    seed: int = 0


@dataclass(frozen=True)
class HumanGames:
    """Observations and actions of the recorded people, a row for each of the two."""

    observations: NDArray[np.int8]  # (rows, width, height, 26)
    actions: NDArray[np.int64]  # (rows,)
    game: NDArray[np.int64]  # (rows,): which game, so that one can be held out

    @property
    def count(self) -> int:
        """How many games there are."""
        return int(self.game[-1]) + 1


def recordings(layout: Layout) -> Path:
    """Return where the bundled games of people on a layout are."""
    return _DATA / f"{layout.name}_train.jsonl.gz"


def read_human_games(path: Path, layout: Layout) -> HumanGames:
    """Return all recorded timesteps with an action. Raises OSError or ValueError for an unreadable file."""
    kitchens = Kitchens.start(layout)
    seen, done, games, game = [], [], [], -1
    with gzip.open(path, "rt", encoding="utf-8") as lines:
        for line in lines:
            record = json.loads(line)
            game += record["k"] == "ep"
            if record["k"] == "s" and "a" in record:
                kitchens.restore(record)
                seen.append(kitchens.encode(horizon=0)[0])  # their games were longer: the urgency plane stays empty
                done.append(record["a"])
                games.append((game, game))
    if not seen:
        raise ValueError(f"{path}: holds no recorded actions. Give a file of recorded human games.")
    observations = np.concatenate(seen)
    return HumanGames(observations, np.array(done, np.int64).ravel(), np.array(games, np.int64).ravel())


def measured_games(count: int) -> tuple[int, ...]:
    """Return the later half of `count` recorded games: the training data of the behaviour-cloned human for
    measuring."""
    return tuple(range(count // 2, count))


def learnt_games(count: int) -> tuple[int, ...]:
    """Return the earlier half of `count` recorded games: the training data of the behaviour-cloned humans that
    predictors train with."""
    return tuple(range(count // 2))


def companions(count: int) -> dict[str, tuple[CloningConfig, Mode]]:
    """Return the configs of the behaviour-cloned humans that predictors train with, by name, for `count` recorded
    games; they differ, as people do."""
    learnt = learnt_games(count)
    decided, patient = replace(LIKE_PEOPLE, temperature=0.7), replace(LIKE_PEOPLE, stuck_after=8)
    kinds = (
        (CloningConfig(learnt), LIKE_PEOPLE),
        (CloningConfig(learnt, hidden=(32,), noise=0.2), LIKE_PEOPLE),
        (CloningConfig(learnt, hidden=(128, 64), weight_decay=0.3), decided),
        (CloningConfig(learnt, noise=0.3), patient),
    )
    found = {}
    for number, (last, (config, mode), _) in enumerate(product(learnt, kinds, range(NETWORKS_OF_A_KIND))):
        games = (*(game for game in learnt if game != last), last)
        found[f"human_{number:02}"] = replace(config, games=games, seed=number), mode
    return found


def train_human_bc(games: HumanGames, layout: Layout, config: CloningConfig) -> tuple[MlpPolicy, dict[str, float]]:
    """Train the network, and return it with its figures on the held-out game."""
    torch.manual_seed(config.seed)
    draws = np.random.default_rng(config.seed)
    network = build_network(NetworkConfig(hidden=config.hidden), layout)
    assert isinstance(network, MlpPolicy)  # noqa: S101 the default kind
    with torch.no_grad():
        first: Any = network.head.layers[0].weight
        # entries that never changed in the recordings must have no influence
        first *= _changing(games, config, network)
    entries = torch.from_numpy(games.observations).flatten(1)[:, network.columns].float()
    actions = torch.from_numpy(games.actions)
    apart = torch.from_numpy(games.game == config.games[-1])
    optimiser = torch.optim.AdamW(network.parameters(), config.learning_rate, weight_decay=config.weight_decay)
    rows = np.flatnonzero(np.isin(games.game, config.games[:-1]))
    best, kept = {"loss": float("inf")}, {}
    for epoch in range(config.epochs):
        order = draws.permutation(rows)
        for first in range(0, len(order), config.minibatch):
            some = torch.from_numpy(order[first : first + config.minibatch])
            shown = entries[some] * (torch.rand(len(some), entries.shape[1]) >= config.noise)
            loss = functional.cross_entropy(network.from_columns(shown)[0], actions[some])
            optimiser.zero_grad()
            loss.backward()  # type: ignore[no-untyped-call]
            optimiser.step()
        with torch.inference_mode():
            logits = network.from_columns(entries[apart])[0]
            figures = {
                "loss": float(functional.cross_entropy(logits, actions[apart])),
                "accuracy": float((logits.argmax(1) == actions[apart]).float().mean()),
            }
        if figures["loss"] < best["loss"]:
            best, kept = {**figures, "epochs": epoch + 1}, {k: v.clone() for k, v in network.state_dict().items()}
    network.load_state_dict(kept)
    return network, best


def _changing(games: HumanGames, config: CloningConfig, network: MlpPolicy) -> torch.Tensor:
    """Return (inputs,): 1 for entries that took more than one value in these recordings."""
    seen = games.observations[np.isin(games.game, config.games)]
    seen = seen.reshape(len(seen), -1)[:, network.columns.numpy()]
    return torch.from_numpy((seen != seen[0]).any(0).astype(np.float32))


def make_companions(folder: Path, layout: Layout, recorded: Path | None = None) -> list[Path]:
    """Write the behaviour-cloned humans that predictors train with, a checkpoint folder each, and return the folders;
    existing ones stay."""
    made: list[Path] = []
    games = read_human_games(recorded or recordings(layout), layout)
    for name, (config, mode) in companions(games.count).items():
        made.append(folder / name)
        if made[-1].is_dir():
            continue
        network, figures = train_human_bc(games, layout, config)
        save_human_bc(folder / name, network, layout, config, figures, mode)
    return made


def save_human_bc(
    folder: Path,
    network: MlpPolicy,
    layout: Layout,
    config: CloningConfig,
    figures: dict[str, float],
    mode: Mode = LIKE_PEOPLE,
) -> str:
    """Write the agent's checkpoint folder, whose name is the agent's, with its card; return its sha256."""
    return save_agent(
        folder,
        network,
        NetworkConfig(hidden=config.hidden),
        layout,
        mode,
        _card(folder.name, layout, config, figures, mode),
        agent=folder.name,
        seed=config.seed,
        measured=figures,
        revision=revision(),
    )


def _card(name: str, layout: Layout, config: CloningConfig, figures: dict[str, float], mode: Mode) -> str:
    """Return the model card: whom the agent imitates, how it acts, and how well it predicts unseen people."""
    numbers = ", ".join(str(game + 1) for game in config.games)
    return "\n".join(
        [
            f"# {name}: a behaviour-cloned human for {layout.name}",
            "",
            f"A small network that imitates the people of games {numbers} of the human-human games recorded on this",
            "layout (150 ms a step): Carroll et al. 2019, collected by CHAI, UC Berkeley, anonymised by them, MIT.",
            "Predictors train with such networks from the earlier half; one from the later half measures them.",
            "It is not a study partner.",
            f"Samples (temperature {mode.temperature:g}); after {mode.stuck_after}",
            f"timesteps without a change of its own cell, facing or hand, {mode.stuck_mix:.0%} of the probability goes",
            "to the four moves.",
            "",
            "| fact | value |",
            "|---|---|",
            f"| likeliest action right, on the game it never saw | {100 * figures['accuracy']:.1f} % |",
            f"| cross-entropy there | {figures['loss']:.3f} |",
            f"| settings | {asdict(config)} |",
            f"| code revision | {revision()} |",
        ]
    )  # fmt: skip


def main() -> None:
    """Train on the bundled recordings and write the agent where studies and evaluations find it."""
    parser = argparse.ArgumentParser(allow_abbrev=False, description=__doc__)
    parser.add_argument("--recordings", type=Path, help="default: tests/data/LAYOUT_train.jsonl.gz")
    parser.add_argument("--layout", default=_DEFAULT)
    parser.add_argument("--out", type=Path, help="default: models/weights/LAYOUT/human_bc")
    parser.add_argument(
        "--companions", type=Path, metavar="FOLDER", help="make those that predictors train with instead"
    )
    arguments = parser.parse_args()
    torch.set_num_threads(1)
    layout = load_layout(arguments.layout)
    if arguments.companions:
        print(*make_companions(arguments.companions, layout, arguments.recordings), sep="\n")
        return
    games = read_human_games(arguments.recordings or recordings(layout), layout)
    config = CloningConfig(measured_games(games.count))
    network, figures = train_human_bc(games, layout, config)
    folder = arguments.out or WEIGHTS / layout.name / NAME
    save_human_bc(folder, network, layout, config, figures)
    print(f"{folder}: right in {figures['accuracy']:.1%} of a game it never saw")


if __name__ == "__main__":
    main()
