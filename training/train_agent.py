"""Train an agent, and write it to disk at several skill levels."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from types import MappingProxyType
from typing import Any

import torch
from safetensors.torch import load_file

from models.networks.checkpoint import load_checkpoint
from models.networks.config import NetworkConfig
from models.networks.policy import MlpPolicy, Network, build_network, network_of, save_agent
from models.protocols import Mode
from overcooked.layout import Layout, parse_layout
from training.agent_config import AgentConfig, network_config
from training.compute import Compute
from training.fast_networks import choose_compute
from training.partners import PartnerPool, load_partners
from training.ppo import PpoTrainer, Progress, run_settings, train
from training.runlog import RunFolder

PEOPLE = Mode(temperature=0.0, stuck_after=8, stuck_mix=0.5)  # chosen by measurement: docs/decisions
NO_FIGURES: Mapping[str, Any] = MappingProxyType({})
SKILLS = (35, 70, 100)  # percent of the best reward of a run


def train_agent(
    config: AgentConfig,
    layout: Layout,
    seed: int,
    path: Path,
    partners: Sequence[Path] = (),
    progress: Progress | None = None,
) -> RunFolder:
    """Train a complete run, or the rest of an interrupted one, in the folder `path`."""
    torch.set_num_threads(1)
    names = [f"{path.parent.name} {path.name} {load_checkpoint(path).sha256[:12]}" for path in partners]
    folder = RunFolder(path, run_settings(config, layout, seed, names))
    if not folder.done():
        compute, measured = choose_compute(network_config(config), layout)
        folder.note_compute(str(compute), measured)
        pool = _partner_pool(partners, layout, config, compute) if partners else None
        train(PpoTrainer(config, layout, seed, pool, compute), folder, progress)
    return folder


def _partner_pool(folders: Sequence[Path], layout: Layout, config: AgentConfig, compute: Compute) -> PartnerPool:
    """Return the partners on the ego agent's device; their networks may be of another kind than its own."""
    networks = load_partners(folders, layout)
    kind = NetworkConfig("mlp" if isinstance(networks[0], MlpPolicy) else "cnn")
    own = compute if kind.kind == config.network else choose_compute(kind, layout)[0]
    return PartnerPool(networks, layout, config.games_per_partner, own)


def skill_snapshot(folder: RunFolder, skill: int) -> tuple[int, float, Path]:
    """Return the snapshot, up to the best one, whose reward is nearest to `skill` percent of the run's best:
    (timesteps, reward, file).
    """
    snapshots = folder.snapshots()
    best = max(range(len(snapshots)), key=lambda k: snapshots[k][1])
    wanted = snapshots[best][1] * skill / 100
    return min(snapshots[: best + 1], key=lambda snapshot: abs(snapshot[1] - wanted))


def snapshot_network(path: Path, config: AgentConfig, layout: Layout) -> tuple[Network, NetworkConfig]:
    """Load the network of a snapshot file."""
    settings = network_config(config)
    network = build_network(settings, layout)
    network.load_state_dict({name: tensor.float() for name, tensor in load_file(path).items()})
    return network, settings


def write_agent(
    folder: RunFolder,
    skill: int,
    target: Path,
    name: str,
    mode: Mode = PEOPLE,
    figures: Mapping[str, Any] = NO_FIGURES,
) -> str:
    """Write a run's network at a skill level as a checkpoint with its card; return its sha256."""
    settings = folder.settings
    layout = parse_layout(settings["grid"], settings["layout"])
    config = AgentConfig().changed(settings["config"], str(folder.path))
    timesteps, reward, path = skill_snapshot(folder, skill)
    network, network_config = snapshot_network(path, config, layout)
    facts = {
        "agent": name,
        "seed": settings["seed"],
        "skill": skill,
        "timesteps": timesteps,
        "training_reward": round(reward, 1),
    }
    text = card(folder, name, skill, mode, {**facts, **figures})
    return save_agent(
        target, network, network_config, layout, mode, text, **facts, revision=folder.revision, measured=dict(figures)
    )


def publish(folder: Path, target: Path, name: str, figures: Mapping[str, Any]) -> str:
    """Write a finished agent's checkpoint again under the name that studies use, with its measured performance in its
    config and card; return its sha256."""
    checkpoint = load_checkpoint(folder)
    network, layout, config = network_of(checkpoint)
    facts = {key: checkpoint.config[key] for key in ("seed", "skill", "timesteps", "training_reward", "revision")}
    lines = checkpoint.card.splitlines()
    lines[0] = f"# {name}: an agent for {layout.name}"
    last = next(number for number, line in enumerate(lines) if line.startswith("| training reward"))
    rows = [f"| {key.replace('_', ' ')} | {_formatted(value)} |" for key, value in figures.items()]
    text = "\n".join([*lines[: last + 1], *rows, *lines[last + 1 :]])
    mode = Mode(**checkpoint.config["mode"])
    return save_agent(target, network, config, layout, mode, text, agent=name, **facts, measured=dict(figures))


def card(folder: RunFolder, name: str, skill: int, mode: Mode, facts: dict[str, Any]) -> str:
    """Return the model card: what the agent is, how it was trained, how it performs."""
    settings = folder.settings
    partners = settings["partners"]
    how = f"best response to {len(partners)} partners (fictitious co-play)" if partners else "self-play"
    config = AgentConfig().changed(settings["config"], str(folder.path))
    used_a_gpu = not all(device.startswith(("cpu", "unknown")) for device in folder.compute().split("; "))
    lines = [
        f"# {name}: an agent for {settings['layout']}",
        "",
        f"A {config.network} trained by PPO, {how}; kept at {skill} % of its run's best reward.",
        *_beginning(config),
        f"Acts with temperature {mode.temperature:g}; after {mode.stuck_after} timesteps without a change of its own",
        f"cell, facing or hand, {mode.stuck_mix:.0%} of the probability goes to the four moves, so that two chefs",
        "never block each other for good.",
        "",
        "| fact | value |",
        "|---|---|",
        *(f"| {key.replace('_', ' ')} | {_formatted(value)} |" for key, value in facts.items()),
        f"| environment timesteps of the run | {config.total_timesteps:,} |",
        f"| training time{'' if used_a_gpu else ', one core'} | {folder.seconds():.0f} s |",
        f"| computed with | {folder.compute()} |",
        f"| code revision | {folder.revision} |",
        f"| settings other than the defaults | {config.differences() or 'none'} |",
        "",
        "Points are per episode of 400 timesteps; self-play and held-out figures are in the mode above, weights as",
        "stored (16 bits).",
        "The grid is in config.json.",
    ]
    return "\n".join(lines)


def _beginning(config: AgentConfig) -> list[str]:
    if not config.imitation_updates:
        return []
    return [f"It began with {config.imitation_updates} gradient steps towards what the scripted planner does."]


def _formatted(value: Any) -> str:
    """Format a figure; a mean with its standard error."""
    if isinstance(value, dict) and set(value) == {"mean", "se"}:
        return f"{value['mean']} ± {value['se']}"
    if isinstance(value, dict):
        return "; ".join(f"{key}: {_formatted(item)}" for key, item in value.items())
    return str(value)
