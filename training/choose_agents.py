"""Choose the runs that become the agents of studies, by measurement in the mode in which participants meet them."""

import json
import shutil
from collections.abc import Callable, Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

import torch

from models.agents.catalogue import KINDS, TRAINED, WEIGHTS, agent_set, load_agent, our_agent
from models.agents.checked_policy import CheckedPolicy
from models.networks.policy import NetworkPolicy, load_network
from models.protocols import Policy
from overcooked.constants import HORIZON
from overcooked.layout import Layout
from training.evaluate_agents import EvaluatedAgent, measured, measured_with
from training.pipeline.study_tasks import Work
from training.train_agent import PEOPLE, SKILLS, publish

HELD_OUT = "held_out"
_DECISION = "decision.json"


def choose_sp(work: Work, layout: Layout) -> None:
    """Choose the target run with the best self-play score. Writes <folder>/agent."""
    runs = work.inputs.items()
    entries = {name: measured(layout, "sp", EvaluatedAgent(_policy(folder), PEOPLE), ()) for name, folder in runs}
    scores = {name: {"self_play": entry["self_play"]["mean"]} for name, entry in entries.items()}
    best = max(scores, key=lambda name: scores[name]["self_play"])
    _write_choice(work, best, entries[best], scores)


def choose_fcp(work: Work, layout: Layout) -> None:
    """Choose the FCP run with the best score with unseen partners, among those with at least half of SP's self-play
    score (or the one that comes nearest)."""
    sp = work.inputs["choose_sp"]
    decision = json.loads((sp / _DECISION).read_text(encoding="utf-8"))
    unseen_partners = [
        folder for name, folder in work.inputs.items() if _is_unseen(name, decision["best"], work.inputs)
    ]
    runs = {name: folder for name, folder in work.inputs.items() if name.startswith("target_fcp")}
    levels = _levels(unseen_partners)
    entries = {
        name: measured(layout, "fcp", EvaluatedAgent(_policy(folder), PEOPLE), levels) for name, folder in runs.items()
    }
    scores = {name: {key: entry[key]["mean"] for key in ("self_play", "held_out")} for name, entry in entries.items()}
    best = best_fcp(scores, decision["measured"]["self_play"]["mean"])
    _write_choice(work, best, entries[best], scores)


def best_fcp(scores: Mapping[str, Mapping[str, float]], of_sp: float) -> str:
    """Return the run that `choose_fcp` takes; `of_sp`: SP's self-play score, 0 if it never served a soup."""
    enough = 0.5 * of_sp
    return max(scores, key=lambda name: (min(enough, scores[name]["self_play"]), scores[name]["held_out"]))


def publish_agents(work: Work, layout: Layout) -> None:
    """Copy the agents of our own recipe into models/weights/<layout>. Where the kitchen also has the published agents,
    only `sp_strong` and `fcp_strong` are replaced, and the population stays the published one."""
    names = {kind: our_agent(kind, layout.name) for kind in KINDS}
    if tuple(names.values()) == KINDS:
        publish_from(work.inputs, layout, _copy)
        return
    for kind, name in names.items():
        _copy(work.inputs[f"choose_{kind}"] / "agent", WEIGHTS / layout.name / name)


def publish_from(inputs: Mapping[str, Path], layout: Layout, copy_partner: Callable[[Path, Path], None]) -> None:
    """Copy the chosen agents, the pretrained encoder, the population, and the partners that no target met from the
    folders of finished tasks into models/weights/<layout>. `copy_partner` copies an agent that is only a partner."""
    target = WEIGHTS / layout.name
    shutil.rmtree(target / HELD_OUT, ignore_errors=True)
    for name, folder in inputs.items():
        role, _, seed = name.rpartition("_")
        if role == "choose":
            _copy(folder / "agent", target / seed)
        elif role == "features":
            _copy(folder / "100", target / "features")
        elif role.startswith("population"):
            kind = role.removeprefix("population_")
            for skill in SKILLS:
                copy_partner(folder / str(skill), target / "population" / f"{kind}_{seed}_{skill}")
    chosen = json.loads((inputs["choose_sp"] / _DECISION).read_text(encoding="utf-8"))["best"]
    for name, folder in inputs.items():
        if _is_unseen(name, chosen, inputs) and not name.startswith("population_fcp"):
            for skill in SKILLS:
                copy_partner(folder / str(skill), target / HELD_OUT / f"{name}_{skill}")


def evaluate_bundled(
    layout: Layout, names: Sequence[str] = TRAINED, episodes: int = 40, timesteps: int = HORIZON
) -> list[dict[str, Any]]:
    """Return what `kitchenmind evaluate agents --json` prints for one layout: the bundled agents in self-play and with
    the bundled partners that neither has met in training."""
    torch.set_num_threads(1)  # for networks this small, threads only cost time
    bundled = WEIGHTS / layout.name
    folders = sorted([*(bundled / HELD_OUT).glob("*"), *(bundled / "population").glob("fcp_*")])
    unseen_partners: list[Policy] = [NetworkPolicy(load_network(folder)) for folder in folders]
    present = [name for name in names if name == "planner" or (WEIGHTS / layout.name / name).is_dir()]
    players = {name: EvaluatedAgent(*load_agent(name, layout)) for name in present}
    return [
        measured(layout, name, player, unseen_partners, episodes, timesteps) | agent_set(name, layout.name)
        for name, player in players.items()
    ]


def evaluate_with(
    layout: Layout, partner: str, names: Sequence[str] = TRAINED, episodes: int = 40, timesteps: int = HORIZON
) -> list[dict[str, Any]]:
    """Return what `kitchenmind evaluate agents --partner PARTNER --json` prints for one layout. Raises what
    `load_agent` raises."""
    torch.set_num_threads(1)
    present = [name for name in names if (WEIGHTS / layout.name / name).is_dir()]
    policy, mode = load_agent(partner, layout)
    other = EvaluatedAgent(CheckedPolicy(policy, partner), mode)
    players = {name: EvaluatedAgent(*load_agent(name, layout)) for name in present}
    return [
        measured_with(layout, name, player, partner, other, (episodes, timesteps)) | agent_set(name, layout.name)
        for name, player in players.items()
    ]


def _is_unseen(name: str, chosen: str, inputs: Iterable[str]) -> bool:
    """Return whether neither target met this agent in training: SP targets that were not chosen, the last SP agent of
    the population (not used to train the FCP targets), and the population's FCP agents."""
    last = max((other for other in inputs if other.startswith("population_sp_")), key=_seed)
    unchosen = name.startswith("target_sp_") and name != chosen
    return name == last or unchosen or name.startswith("population_fcp_")


def _seed(name: str) -> int:
    return int(name.rpartition("_")[2])


def _write_choice(work: Work, best: str, entry: Mapping[str, Any], scores: Mapping[str, Any]) -> None:
    """Write the chosen agent to <folder>/agent with its figures, and the decision next to it."""
    figures = {key: entry[key] for key in ("self_play", "held_out", "episodes") if key in entry}
    publish(work.inputs[best] / "100", work.folder / "agent", entry["agent"], {**figures, "candidates": dict(scores)})
    decision = {"best": best, "scores": dict(scores), "measured": entry}
    (work.folder / _DECISION).write_text(json.dumps(decision, indent=2), encoding="utf-8")


def _policy(folder: Path) -> Policy:
    return NetworkPolicy(load_network(folder / "100"))


def _levels(folders: Sequence[Path]) -> list[Policy]:
    return [NetworkPolicy(load_network(folder / str(skill))) for folder in folders for skill in SKILLS]


def _copy(folder: Path, target: Path) -> None:
    shutil.rmtree(target, ignore_errors=True)
    target.parent.mkdir(parents=True, exist_ok=True)
    shutil.copytree(folder, target)
