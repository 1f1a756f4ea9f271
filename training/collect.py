"""Collect the training data of a predictor: the target with every partner, in both seats, each partner deterministic
and sampling.

Algorithm 1 of the paper: partners x 4 settings x 5 trajectories x 800 timesteps, one shard a partner, and a
manifest. The split is by partner agent (all its skill levels together), never by window.
"""

import hashlib
import json
from collections import Counter
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from safetensors.numpy import load_file, save

from models.acting import GREEDY, SAMPLED, Stuck, distribution, draw
from models.protocols import Mode, Policy, Probabilities
from overcooked.constants import ACTIONS, HORIZON, PLAYERS
from overcooked.layout import Layout
from overcooked.state import Kitchens

TRAIN, VALIDATION, TEST = "train", "validation", "test"
MANIFEST = "manifest.json"


@dataclass(frozen=True)
class Target:
    """The agent to predict, acting as in a study. `sha256` identifies its weights."""

    name: str
    policy: Policy
    mode: Mode
    sha256: str = ""


@dataclass(frozen=True)
class Partner:
    """A partner of the target. The split keeps partners of the same `agent` together; `mode` None: deterministic and
    sampling. `sha256` identifies the agent, as its name may later mean another one."""

    name: str
    agent: str
    kind: str  # sp, fcp, self, or extra (only ever trained on)
    policy: Policy
    mode: Mode | None = None
    sha256: str = ""


@dataclass(frozen=True)
class CollectionPlan:
    """How much is collected with each partner."""

    trajectories: int = 5
    timesteps: int = 800  # of a trajectory: episodes of 400 one after the other
    seed: int = 0


Shard = dict[str, NDArray[Any]]
Report = Callable[[float], None]


def split_by_agent(partners: Iterable[Partner]) -> dict[str, str]:
    """Return agent -> train, validation or test, about 3:1:1 within each kind; the target itself and extras are for
    training. Raises ValueError if there are too few agents to hold any out.
    """
    kinds: dict[str, list[str]] = {}
    for partner in partners:
        agents = kinds.setdefault("train" if partner.kind in ("self", "extra") else partner.kind, [])
        if partner.agent not in agents:
            agents.append(partner.agent)
    split = dict.fromkeys(kinds.pop("train", []), TRAIN)
    if any(len(agents) < 3 for agents in kinds.values()):
        kinds = {"any": [agent for agents in kinds.values() for agent in agents]}
    for agents in kinds.values():
        if len(agents) < 3:
            raise ValueError(f"{len(agents)} partner agents cannot be split into three parts. Train at least 3.")
        apart = max(1, len(agents) // 5)
        for k, agent in enumerate(sorted(agents)):
            last = len(agents) - 1 - k
            split[agent] = TEST if last < apart else VALIDATION if last < 2 * apart else TRAIN
    return split


def collect(
    folder: Path,
    layout: Layout,
    target: Target,
    partners: Sequence[Partner],
    plan: CollectionPlan,
    report: Report | None = None,
) -> Path:
    """Write one shard per partner and the manifest to `folder`; existing shards of the same partners and settings stay.
    Returns the manifest's path. Raises ValueError if `folder` holds other games."""
    _refuse_two_of_one_name(partner.name for partner in partners)
    folder.mkdir(parents=True, exist_ok=True)
    path = folder / MANIFEST
    head = {
        "format": "kitchenmind games 1",
        "layout": layout.name,
        "grid": layout.text,
        "target": {"name": target.name, "sha256": target.sha256, "mode": asdict(target.mode)},
        "plan": asdict(plan),
    }
    known = {partner.name: partner.sha256 for partner in partners}
    done = _known_shards(path, head, known)
    split = split_by_agent(partners)
    for number, partner in enumerate(partners):
        file = folder / f"{partner.name}.safetensors"
        if done.get(partner.name, {}).get("sha256") != _digest(file):
            file.write_bytes(save(games_with(layout, target, partner, plan)))  # a full disk is an OSError
        done[partner.name] = {
            "agent": partner.agent, "kind": partner.kind, "split": split[partner.agent], "sha256": _digest(file)
        }  # fmt: skip
        _write(path, {**head, "partners": {name: known[name] for name in done}, "shards": done})
        if report:
            report((number + 1) / len(partners))
    _write(path, {**head, "partners": known, "shards": {name: done[name] for name in known}})
    return path


def read_manifest(folder: Path) -> dict[str, Any]:
    """Read the manifest of collected games. Raises FileNotFoundError with the remedy."""
    path = folder / MANIFEST
    if not path.is_file():
        raise FileNotFoundError(f"{path}: no games were collected here. Run kitchenmind collect first.")
    manifest: dict[str, Any] = json.loads(path.read_text(encoding="utf-8"))
    return manifest


def games_of_agent(folder: Path, layout: Layout, target: Target) -> dict[str, Any]:
    """Read the manifest of games that this agent played in this kitchen. Raises ValueError if they are others,
    FileNotFoundError if there are none."""
    manifest = read_manifest(folder)
    if manifest["grid"] != layout.text:
        raise ValueError(
            f"{folder}: holds games of another kitchen ({manifest['layout']}) than {layout.name}. Give its --layout, "
            "or collect games here first."
        )
    if manifest["target"]["sha256"] != target.sha256:
        raise ValueError(f"{folder}: was collected with another agent than {target.name}. Collect its games first.")
    return manifest


def read_shard(folder: Path, name: str, sha256: str) -> Shard:
    """Read one partner's games. Raises ValueError if the bytes are not those of the manifest."""
    file = folder / f"{name}.safetensors"
    if _digest(file) != sha256:
        raise ValueError(f"{file}: is missing or was changed. Remove it and collect again.")
    return load_file(file)


def whole_episodes(shard: Shard) -> Shard:
    """Return the games without the timesteps of a last episode that they do not finish."""
    timesteps = shard["timestep"].shape[1]
    whole = timesteps - timesteps % min(HORIZON, timesteps)
    return {name: values if name == "seat" else values[:, :whole] for name, values in shard.items()}


def games_with(layout: Layout, target: Target, partner: Partner, plan: CollectionPlan) -> Shard:
    """Return the target's games with one partner: 4 settings x `trajectories` games G of T timesteps. Arrays, target
    first:

    `players` (G, T, 2, 4) as in the state (by seat), `contents` (G, T, width, height), `timestep` (G, T), `actions`
    (G, T, 2) own first, `law` (G, T, 6) of the target's action, `stuck` (G, T, 2) own first, `seat` (G,) the target's.
    """
    games, timesteps = 2 * PLAYERS * plan.trajectories, plan.timesteps
    number = np.arange(games)
    seat = (number // (games // 2)).astype(np.int8)
    decided = number // plan.trajectories % 2 == 0
    seats = np.stack([seat, 1 - seat], 1)  # (G, 2): of the target, of the partner
    random = np.random.default_rng([plan.seed, *partner.name.encode()])
    shard = {**_empty_shard(layout, games, timesteps), "seat": seat}
    kitchens = Kitchens.start(layout, games)
    stuck = [Stuck(kitchens.players[number, seats[:, k]]) for k in range(PLAYERS)]
    events = np.zeros((games, PLAYERS), np.int32)
    for t in range(timesteps):
        if t % HORIZON == 0:
            kitchens = Kitchens.start(layout, games)
            for k in range(PLAYERS):
                stuck[k].begin(number, kitchens.players[number, seats[:, k]])
        seen = kitchens.encode()
        own = target.policy.probabilities(seen[number, seats[:, 0]])
        other = partner.policy.probabilities(seen[number, seats[:, 1]])
        probabilities = distribution(own, stuck[0].counts, target.mode)
        of_partner = _partner_distribution(partner, other, stuck[1], decided)
        actions = np.stack([draw(probabilities, random.random(games)), draw(of_partner, random.random(games))], 1)
        state = {"players": kitchens.players, "contents": kitchens.contents, "timestep": kitchens.timestep}
        stuck_counts = np.stack([counter.counts for counter in stuck], 1)
        now = {**state, "actions": actions, "law": probabilities, "stuck": stuck_counts}
        for name, values in now.items():
            shard[name][:, t] = values
        kitchens.step(np.take_along_axis(actions, seats.astype(np.intp), 1), events)  # back into the order of the seats
        for k in range(PLAYERS):
            stuck[k].update(kitchens.players[number, seats[:, k]])
    return shard


def _empty_shard(layout: Layout, games: int, timesteps: int) -> Shard:
    """Return the arrays that are filled timestep by timestep."""
    shape = (games, timesteps)
    return {
        "players": np.zeros((*shape, PLAYERS, 4), np.int8),
        "contents": np.zeros((*shape, layout.width, layout.height), np.int8),
        "timestep": np.zeros(shape, np.int16),
        "actions": np.zeros((*shape, PLAYERS), np.int8),
        "law": np.zeros((*shape, ACTIONS), np.float16),
        "stuck": np.zeros((*shape, PLAYERS), np.int16),
    }


def _partner_distribution(
    partner: Partner, probabilities: Probabilities, stuck: Stuck, decided: NDArray[np.bool_]
) -> Probabilities:
    if partner.mode is not None:
        return distribution(probabilities, stuck.counts, partner.mode)
    greedy = distribution(probabilities, stuck.counts, GREEDY)
    return np.where(decided[:, None], greedy, distribution(probabilities, stuck.counts, SAMPLED))


def _refuse_two_of_one_name(names: Iterable[str]) -> None:
    """Raise ValueError if the games of one partner would be taken for those of another."""
    twice = [name for name, count in Counter(names).items() if count > 1]
    if twice:
        raise ValueError(f"two partners are called {twice[0]!r}. Rename the file or folder of one of them.")


def _known_shards(path: Path, head: dict[str, Any], partners: Mapping[str, str]) -> dict[str, Any]:
    """Return the shards that are there already with these partners: name -> SHA-256 of the agent."""
    if not path.is_file():
        return {}
    known = json.loads(path.read_text(encoding="utf-8"))
    shards: dict[str, Any] = known.pop("shards")
    met: dict[str, str] = known.pop("partners", {})  # games of an earlier version do not say with whom they are
    if known != json.loads(json.dumps(head)):
        raise ValueError(f"{path.parent}: holds games of another target or plan. Remove it or give another --out.")
    return {name: facts for name, facts in shards.items() if name in partners and met.get(name) == partners[name]}


def _write(path: Path, content: dict[str, Any]) -> None:
    new = path.with_suffix(".new")
    new.write_text(json.dumps(content, indent=1) + "\n", encoding="utf-8")
    new.replace(path)


def _digest(file: Path) -> str:
    return hashlib.sha256(file.read_bytes()).hexdigest() if file.is_file() else ""
