"""The partners with which a target plays while games are collected: the population, itself, and extra agents for
variety.
"""

import re
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

from models.acting import GREEDY, SAMPLED, distribution
from models.agents.catalogue import agent_sha256, load_agent
from models.agents.checked_policy import CheckedPolicy
from models.networks.checkpoint import CheckpointError, load_checkpoint
from models.networks.policy import NetworkPolicy, network_of
from models.protocols import Observations, Policy, Probabilities
from overcooked.constants import ACTIONS
from overcooked.layout import Layout, bundled_grid
from training.collect import TRAIN, Partner, Target, split_by_agent
from training.compute import collecting_device

_MEMBER = re.compile(r"^(?:population_)?(?P<kind>sp|fcp)_(?P<seed>\d+)_(?P<skill>\d+)$")
MIN_PARTNERS = 3  # partner agents
_NOISES = (0.15, 0.3, 0.6)  # shares of random actions among the extras


class NoisyPolicy:
    """A greedy agent that takes a random action in a share of its timesteps."""

    def __init__(self, policy: Policy, share: float) -> None:
        self._policy, self._share = policy, share

    def probabilities(self, observations: Observations) -> Probabilities:
        none = np.zeros(len(observations), np.int64)
        decided = distribution(self._policy.probabilities(observations), none, GREEDY)
        return (1 - self._share) * decided + np.float32(self._share / ACTIONS)


def load_target(name: str, layout: Layout) -> Target:
    """Load the agent to be predicted with `load_agent`, under a name that is a valid folder name: `mine` for mine.onnx,
    `kitchen_Cook` for kitchen:Cook. Raises what `load_agent` raises."""
    agent = load_agent(name, layout)
    short = re.sub(r"[^A-Za-z0-9]+", "_", Path(name).name.removesuffix(".onnx")).strip("_")
    return Target(short, CheckedPolicy(agent.policy, name), agent.mode, agent_sha256(name, layout))


def load_population(folders: Path | Sequence[Path], layout: Layout) -> list[Partner]:
    """Load the partner agents in and below `folders`, at each of their skill levels. Raises CheckpointError if there
    are none, or one is for another kitchen."""
    partners = []
    folders = [folders] if isinstance(folders, Path) else folders
    for config in sorted(config for folder in folders for config in folder.resolve().glob("**/config.json")):
        checkpoint = load_checkpoint(config.parent)
        member = _MEMBER.match(str(checkpoint.config.get("agent", "")))
        if member is None or "population" not in str(config):
            continue
        network, trained_on, _ = network_of(checkpoint)
        if trained_on.text != layout.text:
            raise CheckpointError(f"{config.parent}: is for {trained_on.name}, not {layout.name}. Give another folder.")
        agent = f"{member['kind']}_{member['seed']}"
        policy = NetworkPolicy(network, collecting_device())
        name = f"{agent}_{member['skill']}"
        partners.append(Partner(name, agent, member["kind"], policy, sha256=checkpoint.sha256))
    if not partners:
        raise CheckpointError(f"{', '.join(map(str, folders))}: no population is there. {how_to_get_partners(layout)}")
    return sorted(partners, key=lambda partner: partner.name)


def load_partner_folder(folder: Path, layout: Layout) -> list[Partner]:
    """Return the agents in and below any folder, checkpoints and ONNX files, whatever they are called. Skill levels of
    one agent (`sp_1_35`, `sp_1_100`) stay together. Raises CheckpointError where there are fewer than three, or what
    `load_agent` raises."""
    partners = []
    files = [config.parent for config in folder.glob("**/config.json") if _is_agent(config)]
    for place in sorted([*files, *folder.glob("**/*.onnx")]):
        if any(part.startswith(".") for part in place.relative_to(folder).parts):
            continue  # a checkpoint that was being written when its command was killed
        inside = place.absolute().relative_to(folder.absolute().parent)  # beginning with the folder's own name
        parts = inside.parts[1:] or inside.parts
        name = re.sub(r"[^A-Za-z0-9]+", "_", "_".join(parts).removesuffix(".onnx")).strip("_")
        member = _MEMBER.match(name)
        agent = f"{member['kind']}_{member['seed']}" if member else name
        policy = CheckedPolicy(load_agent(str(place.absolute()), layout).policy, str(place))
        sha256 = agent_sha256(str(place.absolute()), layout)
        partners.append(Partner(name, agent, "partner", policy, sha256=sha256))
    agents = sorted({partner.agent for partner in partners})
    if len(agents) < MIN_PARTNERS:
        found = f"{len(agents)} agents ({', '.join(agents)})" if agents else "no agents"
        raise CheckpointError(f"{folder}: {found} are there. {how_to_get_partners(layout)}")
    return partners


def how_to_get_partners(layout: Layout) -> str:
    """Return which partners are needed and the commands that make them, for a message."""
    place = layout.name if bundled_grid(layout.name) == layout.text else f"{layout.name}.layout"
    return (
        f"A predictor learns from games with at least {MIN_PARTNERS} other agents of the kitchen: one is kept for "
        "validation, one for the test. Train some: "
        f"`kitchenmind train agent --layout {place} --seed 1 --out partners/1`, "
        "again with --seed 2 --out partners/2 and so on, then give their folder: --partners partners. "
        f"(The published population is made by `kitchenmind train study --layouts {layout.name}`.)"
    )


def partners_of(partners: Path | None, population: Path, layout: Layout) -> list[Partner]:
    """Return the partner agents of any folder, or else of a population. Raises CheckpointError."""
    return load_population(population, layout) if partners is None else load_partner_folder(partners, layout)


def _is_agent(config: Path) -> bool:
    return "kitchenmind agent" in config.read_text(encoding="utf-8", errors="replace")


def load_extras(folders: Mapping[str, Path], layout: Layout) -> list[Partner]:
    """Load agents from these checkpoint folders, by name, that are used for training only: the more varied a
    predictor's training partners are, the better it predicts with unseen partners. An agent whose card says that it
    samples always samples. Raises what `load_agent` raises."""
    extras = []
    for name, folder in folders.items():
        policy, mode = load_agent(str(folder.resolve()), layout)
        checked = CheckedPolicy(policy, str(folder))
        sha256 = agent_sha256(str(folder.resolve()), layout)
        its_mode = mode if mode.temperature > 0 else None
        extras.append(Partner(f"extra_{name}", "extra", "extra", checked, its_mode, sha256))
    return extras


def with_itself_and_extras(
    target: Target, population: Sequence[Partner], layout: Layout, extras: bool = True
) -> list[Partner]:
    """Return the paper's 31 partners: the target itself and the population; and, if wanted, extras that are only
    trained on: noisy copies of the target, noisy agents of the training split at all their skills, the scripted
    planner, and the random agent."""
    itself = Partner("itself", "itself", "self", target.policy, sha256=target.sha256)
    everybody = [itself, *population]
    if not extras:
        return everybody
    split = split_by_agent(population)
    trained_with = [partner for partner in population if split[partner.agent] == TRAIN]
    noisy = [
        _noisy(partner, share)
        for partner, shares in [(itself, _NOISES), *((partner, _NOISES[:2]) for partner in trained_with)]
        for share in shares
    ]
    scripted = [
        Partner(f"scripted_{name}", "extra", "extra", *load_agent(name, layout), agent_sha256(name, layout))
        for name in ("planner", "random")
    ]
    return [*everybody, *noisy, *scripted]


def _noisy(partner: Partner, share: float) -> Partner:
    name = f"{partner.name}_noise_{share:.0%}".rstrip("%")
    return Partner(name, "extra", "extra", NoisyPolicy(partner.policy, share), SAMPLED, partner.sha256)
