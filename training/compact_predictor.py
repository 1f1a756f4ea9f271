"""Store a trained predictor with 8 bits for each weight, and measure it again."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Final

from models.networks.checkpoint import load_checkpoint, save_checkpoint
from models.networks.predictor import predictor_network
from models.networks.stored_tensors import restored, stored
from training import publish_intentions, publish_predictor
from training.collect import TRAIN, CollectionPlan
from training.evaluate_predictor import evaluate
from training.population import load_target, partners_of
from training.publish_predictor import HOW, MET, games_of, partners_in, population_folder, unseen_partners

BITS: Final = 8


@dataclass(frozen=True)
class Compacted:
    """Mean accuracy (shares) of the predictor as it was and as it is, with the same unseen partners, and its bytes."""

    before: float
    after: float
    bytes_before: int
    bytes_after: int


def compact(
    folder: Path,
    out: Path,
    plan: CollectionPlan,
    agent: str | None = None,
    population: Path | None = None,
    partners: Path | None = None,
) -> Compacted:
    """Write the predictor in `folder` to `out` (which may be the same) with 8 bits for each weight of its matrices.

    Accuracy and intentions in config and card are measured again, with the weights as stored, in games with the test
    partners of `population` (default: the bundled ones), or of any folder of agents, `partners`. `agent`: the predicted
    agent as `kitchenmind collect` took it (default: the name in the config). Raises ValueError if it is another agent,
    or is stored so already.
    """
    checkpoint = load_checkpoint(folder)
    if checkpoint.bits == BITS:
        raise ValueError(f"{folder}: is stored with {BITS} bits already. There is nothing to do.")
    network, layout = predictor_network(checkpoint)
    target = load_target(agent or str(checkpoint.config["agent"]), layout)
    if target.sha256 != checkpoint.config["agent_sha256"]:
        raise ValueError(f"{folder}: predicts another agent than {target.name}. Say which: --agent.")
    everybody = partners_of(partners, population or population_folder(layout), layout)
    others = unseen_partners(layout, everybody, met=checkpoint.config.get(MET, ()))
    games = games_of(layout, target, others, network, plan)
    before, size = evaluate(network, games).accuracy.mean, _size(folder)
    rounded = replace(checkpoint, tensors=restored(stored(checkpoint.tensors, BITS)))
    network, _ = predictor_network(rounded)
    result = evaluate(network, games)
    config = {**checkpoint.config, **publish_predictor.measured_facts(result, layout, target, network.config.form)}
    lines = {publish_predictor.FIGURES: publish_predictor.figures(result)}
    if network.intentions is not None:
        known = partners_in(TRAIN, layout, everybody)
        measured = publish_intentions.measured_intentions(network, layout, target, others, known, plan)
        with_baseline(measured, checkpoint.config["measured_intentions"])
        config["measured_intentions"] = measured
        lines[publish_intentions.HEADING] = publish_intentions.figures(measured)
    line = f"| stored with | {BITS} bits for each weight of a matrix; mean accuracy before: {100 * before:.2f} % |"
    save_checkpoint(out, config, rounded.tensors, _card(checkpoint.card, lines, line), BITS)
    return Compacted(before, result.accuracy.mean, size, _size(out))


def with_baseline(measured: dict[str, Any], earlier: Mapping[str, Any]) -> None:
    """Put the earlier figures of the baseline, which do not depend on the weights, into `measured` if both are of the
    same states: they were counted in all training games, which are not at hand here."""
    if measured["states"] == earlier["states"]:
        measured["frequent"] = earlier["frequent"]
        for timesteps, values in measured["before"].items():
            values["frequent"] = earlier["before"][timesteps]["frequent"]


def _card(text: str, figures: dict[str, list[str]], line: str) -> str:
    """Return the card with other figures (first line -> lines, up to the table of how it was trained) and one more row
    in the first of these tables."""
    for first, lines in figures.items():
        before, found, after = text.partition(first)
        if found:
            text = before + "\n".join([*lines, "", HOW]) + after.partition(HOW)[2]
    return text.replace(f"{HOW}\n|---|---|\n", f"{HOW}\n|---|---|\n{line}\n", 1)


def _size(folder: Path) -> int:
    return sum(path.stat().st_size for path in folder.iterdir())
