"""Publish a trained predictor: measure it on unseen partners and write its checkpoint folder with a card."""

from collections import Counter
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

from models.agents.catalogue import WEIGHTS, agent_sha256, load_agent
from models.agents.checked_policy import CheckedPolicy
from models.networks.predictor import PredictorNetwork, save_predictor
from overcooked.layout import Layout
from training.collect import TEST, TRAIN, VALIDATION, CollectionPlan, Partner, Target, games_with, split_by_agent
from training.dataset import Episodes, episodes_of, joined
from training.evaluate_predictor import STUCK_AFTER, Evaluation, evaluate
from training.population import load_population
from training.runlog import revision

POPULATION = "population"
FIGURES = "On partner agents that it never saw, in both seats, deciding and sampling (%):"
HOW = "| how | |"
MET: Final = "partners_met"  # a key of a predictor's config: agents of training and early stopping, see `hashes_met`
_DIGITS: Final = 16  # of a SHA-256


@dataclass(frozen=True)
class HowTrained:
    """How a predictor was trained: rows of its card, and `hashes_met` of its games."""

    rows: Mapping[str, Any]
    met: Sequence[str] = ()


def predictor_folder(layout: Layout, agent: str, form: str) -> Path:
    """Return the folder of a bundled predictor."""
    return WEIGHTS / layout.name / f"{agent}_predictor_{form}"


def refuse_other_agents_place(layout: Layout, target: Target) -> None:
    """Raise ValueError if the predictors of this agent would replace those of a bundled agent that has its name."""
    bundled = WEIGHTS / layout.name / target.name
    if bundled.is_dir() and agent_sha256(target.name, layout) != target.sha256:
        raise ValueError(
            f"--publish: {layout.name} has a bundled agent {target.name!r}, whose predictors would be replaced by "
            "those of yours. Give your agent's file or folder another name, or give --out FOLDER instead."
        )


def population_folder(layout: Layout) -> Path:
    """Return the folder of a layout's bundled partners."""
    return WEIGHTS / layout.name / POPULATION


def unseen_games(
    layout: Layout,
    target: Target,
    network: PredictorNetwork,
    population: Path | Sequence[Partner],
    plan: CollectionPlan,
    partner: str | None = None,
) -> Episodes:
    """Return the agent's games with the test partners of a population (a folder, or the partners themselves), or with
    one other agent in the mode of studies, played again (the same seed gives the same games)."""
    return games_of(layout, target, unseen_partners(layout, population, partner), network, plan)


def unseen_partners(
    layout: Layout, population: Path | Sequence[Partner], partner: str | None = None, met: Collection[str] = ()
) -> list[Partner]:
    """Return the test partners of a population (a folder, or the partners themselves), or one other agent in the mode
    of studies. `met`: agents that the predictor met in training, which are left out: a folder that has changed since is
    split in another way. Raises ValueError if no partner is left."""
    if partner is not None:
        policy, mode = load_agent(partner, layout)
        return [Partner(partner, partner, "extra", CheckedPolicy(policy, partner), mode)]
    tested = partners_in(TEST, layout, population)
    unseen = [one for one in tested if one.sha256[:_DIGITS] not in met]
    if not unseen:
        names = ", ".join(one.name for one in tested)
        raise ValueError(f"the predictor has met {names} in training. Give other agents of {layout.name}: --partners.")
    return unseen


def partners_in(split: str, layout: Layout, population: Path | Sequence[Partner]) -> list[Partner]:
    """Return the partners of a population in one part of its split; those of `TEST` are used neither for training nor
    for early stopping."""
    everybody = load_population(population, layout) if isinstance(population, Path) else list(population)
    part_of = split_by_agent(everybody)
    return [partner for partner in everybody if part_of[partner.agent] == split]


def games_of(
    layout: Layout, target: Target, partners: list[Partner], network: PredictorNetwork, plan: CollectionPlan
) -> Episodes:
    """Return games with each of these partners, encoded by the network's encoder."""
    return joined(
        [episodes_of(games_with(layout, target, partner, plan), layout, network.encoder) for partner in partners]
    )


def partners_met(manifest: Mapping[str, Any]) -> dict[str, str]:
    """Return rows for a card, from the manifest of its games: the partners for training, early stopping and
    measuring."""
    by_split: dict[str, set[str]] = {split: set() for split in (TRAIN, VALIDATION, TEST)}
    extras = Counter[str]()
    for name, facts in manifest["shards"].items():
        if facts["kind"] == "extra":
            word = name.removeprefix("extra_").partition("_")[0] if name.startswith("extra_") else "noisy or scripted"
            extras[{"human": "behaviour-cloned humans", "crowd": "auxiliary"}.get(word, word)] += 1
        else:
            by_split[facts["split"]].add(facts["agent"])
    names = {split: ", ".join(sorted(agents)) for split, agents in by_split.items()}
    more = "".join(f"; {count} {word}" for word, count in sorted(extras.items()))
    return {"learned with": names[TRAIN] + more, "stopped on": names[VALIDATION], "measured with": names[TEST]}


def hashes_met(manifest: Mapping[str, Any], begun_with: Mapping[str, Any] | None = None) -> list[str]:
    """Return which agents a predictor met in training and early stopping: the first digits of their hashes, from the
    manifest of its games and the config of the predictor that training began with."""
    parts, hashes = manifest["shards"], manifest.get("partners", {})
    met = {hashes[name][:_DIGITS] for name in hashes if parts[name]["split"] != TEST and hashes[name]}
    return sorted(met | set((begun_with or {}).get(MET, ())))


def write_predictor(
    folder: Path, network: PredictorNetwork, layout: Layout, target: Target, test: Episodes, how: HowTrained
) -> Evaluation:
    """Measure the predictor on `test` and write its checkpoint with the card. Returns what was measured (with the
    weights as trained; they are stored as 16 bits)."""
    result = evaluate(network, test)
    facts = {
        "agent_sha256": target.sha256,
        **({MET: list(how.met)} if how.met else {}),
        **measured_facts(result, layout, target, network.config.form),
        "revision": revision(),
    }
    save_predictor(folder, network, layout, target.name, card(network, layout, target, result, how.rows), **facts)
    return result


def measured_facts(result: Evaluation, layout: Layout, target: Target, form: str) -> dict[str, Any]:
    """Return the config's entries about accuracy."""
    steps = {f"step{k + 1}": round(share, 4) for k, share in enumerate(result.accuracy.steps)}
    return {
        "accuracy": {**steps, "mean": round(result.accuracy.mean, 4)},
        "measured": result.entry(layout.name, target.name, form),
    }


def card(network: PredictorNetwork, layout: Layout, target: Target, result: Evaluation, how: Mapping[str, Any]) -> str:
    """Return the model card: what it predicts, how well, and how it was trained."""
    config, mode = network.config, target.mode
    form = (
        f"a window of 10 timesteps, {config.layers} layers, the last token answers (the paper's form)"
        if config.form == "window"
        else f"causal, one token a timestep, each of {config.layers} layers looks back {config.look_back} timesteps"
    )
    encoder = "pretrained convolutions, frozen" if config.eyes == "cnn" else "the entries that can change"
    lines = [
        f"# Predictor of {target.name} on {layout.name} ({config.form})",
        "",
        f"Predicts the agent's next 3 actions from what both chefs did: {form}. Encoder: {encoder}.",
        f"The agent acts with temperature {mode.temperature:g}, {mode.stuck_mix:.0%} of the probability on the",
        f"four moves after {mode.stuck_after} timesteps without a change of its own cell, facing or hand.",
        f"Agent sha256: {target.sha256[:16]}.",
        "",
        *figures(result),
        "",
        HOW,
        "|---|---|",
        *(f"| {key.replace('_', ' ')} | {value} |" for key, value in how.items()),
        f"| code revision | {revision()} |",
    ]
    return "\n".join(lines)


def figures(result: Evaluation) -> list[str]:
    """Return the card's lines about accuracy."""
    return [
        FIGURES,
        "",
        *_accuracy_table(result),
        "",
        f"Ceiling of step 1, mean of the largest probability of the agent's action: {100 * result.ceiling:.1f} %.",
        f"Expected calibration error: {result.error:.3f}. Windows: {result.windows:,}; nobody stuck (neither chef",
        f"without a change for {STUCK_AFTER} timesteps) in {result.free_share:.0%} of them.",
    ]


def _accuracy_table(result: Evaluation) -> list[str]:
    """Return the lines of the card's table: accuracy of each step, next to the baselines."""
    rows = [
        ("accuracy", result.accuracy), ("repeat the last action", result.repeat),
        ("most frequent action", result.frequent), ("accuracy, nobody stuck", result.free),
        ("repeat, nobody stuck", result.free_repeat), ("most frequent, nobody stuck", result.free_frequent),
    ]  # fmt: skip
    return [
        "| | step 1 | step 2 | step 3 | mean |",
        "|---|---|---|---|---|",
        *(
            f"| {name} | " + " | ".join(f"{100 * share:.1f}" for share in (*accuracy.steps, accuracy.mean)) + " |"
            for name, accuracy in rows
        ),
    ]
