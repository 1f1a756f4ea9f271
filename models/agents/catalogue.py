"""Load the agents that a study names: scripted agents, checkpoints, and models from outside (`blackbox`)."""

from dataclasses import asdict, replace
from hashlib import sha256
from pathlib import Path
from typing import NamedTuple

from models.agents import carrier, planner, scripted
from models.agents.blackbox import is_foreign, load_foreign_agent
from models.agents.model_paths import is_class, source_file
from models.agents.onnx_weights import onnx_sha256
from models.inference.policy_numpy import numpy_policy
from models.networks.checkpoint import SUMS, CheckpointError, load_checkpoint
from models.protocols import Mode, Policy
from overcooked.layout import Layout

WEIGHTS = Path(__file__).parents[1] / "weights"
SCRIPTED: dict[str, tuple[type[Policy], Mode]] = {
    "planner": (planner.PlannerPolicy, planner.MODE),
    "guide": (scripted.GuidePolicy, scripted.SURE),
    "carrier": (carrier.CarrierPolicy, scripted.SURE),
    "random": (scripted.UniformPolicy, scripted.PLAIN),
    "stay": (scripted.StayPolicy, scripted.SURE),
}
KINDS = ("sp", "fcp")  # of the agents that a study trains
_STRONG = "_strong"  # marks agents of our own recipe, where a kitchen also has agents of the published one
TRAINED = (*KINDS, *(f"{kind}{_STRONG}" for kind in KINDS))  # the bundled agents that `kitchenmind evaluate` measures
TEMPERATURES = {"greedy": 0.0, "sampled": 1.0}  # by the suffix after the @ of an agent's name


class LoadedAgent(NamedTuple):
    """An agent ready to play: its policy, and how actions are drawn from it."""

    policy: Policy
    mode: Mode


class UnknownAgent(ValueError):
    """The catalogue has no agent of that name for the layout; the message lists those it has."""


def agent_names(layout: str) -> list[str]:
    """Return the agents that can play on a layout: scripted ones and bundled checkpoints."""
    bundled = [path.parent.name for path in sorted((WEIGHTS / layout).glob("*/config.json")) if _is_agent(path)]
    return [*SCRIPTED, *bundled]


def strong(kind: str) -> str:
    """Return the name of the agent of our own recipe in a kitchen that has both sets."""
    return f"{kind}{_STRONG}"


def our_agent(kind: str, layout: str) -> str:
    """Return the name that the agent of our own recipe has in a kitchen: `sp_strong` if the kitchen also has the
    published one, else `sp`."""
    return strong(kind) if (WEIGHTS / layout / strong(kind)).is_dir() else kind


def agent_set(name: str, layout: str) -> dict[str, str]:
    """Return the entry of `evaluate --json` that says by which recipe a bundled agent was trained: "published" (the
    paper's) or "strong" (ours, which plays better). Empty for other agents."""
    if name not in TRAINED:
        return {}
    return {"agent_set": "strong" if our_agent(name.removesuffix(_STRONG), layout) == name else "published"}


def load_agent(name: str, layout: Layout) -> LoadedAgent:
    """Load the agent of that name, in that folder, or from outside (`module:Class`, an ONNX file, an address) for
    `layout`; `name@greedy` and `name@sampled` override how its card says it acts. Raises UnknownAgent, CheckpointError
    or BlackBoxError."""
    base, wanted = _parts(name)
    agent = _load(base, layout)
    if not wanted:
        return agent
    if wanted not in TEMPERATURES:
        raise UnknownAgent(f"{name}: after @ comes how the agent acts: {', '.join(TEMPERATURES)}.")
    return LoadedAgent(agent.policy, replace(agent.mode, temperature=TEMPERATURES[wanted]))


def _parts(name: str) -> tuple[str, str]:
    """Split off how the agent shall act ("": as its card says). An address may have an @ of its own."""
    base, _, wanted = name.rpartition("@")
    return (base, wanted) if base and (wanted in TEMPERATURES or not is_foreign(name)) else (name, "")


def _load(name: str, layout: Layout) -> LoadedAgent:
    if is_foreign(name):
        return LoadedAgent(*load_foreign_agent(name, layout))
    if name in SCRIPTED:
        scripted_policy, mode = SCRIPTED[name]
        return LoadedAgent(scripted_policy(), mode)
    checkpoint = load_checkpoint(agent_folder(name, layout))
    policy, trained_on = numpy_policy(checkpoint)
    if trained_on.text != layout.text:
        raise CheckpointError(
            f"{checkpoint.folder}: this agent was trained on another grid ({trained_on.name}) and cannot play "
            f"{layout.name}. Choose one of: {', '.join(agent_names(layout.name))}."
        )
    return LoadedAgent(policy, Mode(**checkpoint.config["mode"]))


def agent_folder(name: str, layout: Layout) -> Path:
    """Return the folder of an agent's checkpoint: a path as it is, a name among the bundled ones. Raises
    UnknownAgent."""
    bundled = WEIGHTS / layout.name / name
    folder = Path(name) if "/" in name or (not bundled.is_dir() and Path(name).is_dir()) else bundled
    if not folder.is_dir():
        if "/" in name:
            raise UnknownAgent(f"there is no folder {folder.absolute()}. Give a folder that `kitchenmind train` wrote.")
        known = ", ".join(agent_names(layout.name))
        raise UnknownAgent(f"no agent {name!r} for {layout.name}. Known: {known}; or give a checkpoint folder.")
    return folder


def agent_sha256(name: str, layout: Layout) -> str:
    """Return the hash that identifies this agent in data: its checkpoint's sha256; for a scripted one, the hash of name
    and mode; for one from outside, that of its file, of its module's source file, or of its address."""
    base, _ = _parts(name)
    if base.endswith(".onnx") and Path(base).is_file():
        return onnx_sha256(Path(base))
    if is_foreign(base):
        file = Path(base) if not is_class(base) else source_file(base)
        return sha256(file.read_bytes() if file is not None and file.is_file() else base.encode()).hexdigest()
    if base in SCRIPTED:
        return sha256(f"{base} {asdict(SCRIPTED[base][1])}".encode()).hexdigest()
    return sha256((agent_folder(base, layout) / SUMS).read_bytes()).hexdigest()


def _is_agent(config: Path) -> bool:
    return "kitchenmind agent" in config.read_text(encoding="utf-8")
