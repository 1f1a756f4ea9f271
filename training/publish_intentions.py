"""Add a measured decoder of intentions to a predictor, from its collected games."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any, Final

from models.networks.checkpoint import Checkpoint, load_checkpoint, save_checkpoint
from models.networks.intentions import IntentionDecoder
from models.networks.predictor import PredictorNetwork, predictor_network
from overcooked.layout import Layout
from training.collect import (
    TEST,
    TRAIN,
    VALIDATION,
    CollectionPlan,
    Partner,
    Target,
    games_with,
    read_manifest,
)
from training.evaluate_intentions import intention_entry, predicted_intentions
from training.intention_baselines import FrequentNext
from training.predictor_config import IntentionSettings
from training.publish_predictor import HOW, partners_met
from training.runlog import revision
from training.train_intentions import read_shards, states_of, train_intentions

HEADING: Final = "## Intentions"
SECONDS_OF_A_TIMESTEP: Final = 0.2
PREFIX: Final = "intentions."


def add_intentions(
    predictor: Path,
    games: Path,
    settings: IntentionSettings,
    out: Path,
    report: Callable[[float], None] | None = None,
) -> dict[str, Any]:
    """Train a decoder of intentions on a predictor's tokens and write the predictor with it to `out` (which may be its
    own folder). Returns what was measured on the test partners. Raises ValueError where the games are of another agent
    or kitchen."""
    checkpoint, manifest = load_checkpoint(predictor), read_manifest(games)
    network, layout = predictor_network(checkpoint)
    if manifest["grid"] != layout.text or manifest["target"]["sha256"] != checkpoint.config["agent_sha256"]:
        raise ValueError(f"{games}: holds games of another agent or kitchen than {predictor}. Collect its games first.")
    shards = read_shards(games, TRAIN, settings.states)
    train = states_of(shards, layout, network)
    validation = states_of(read_shards(games, VALIDATION, settings.states // 3), layout, network)
    network.intentions = train_intentions(network, layout, train, validation, settings, report)
    frequent = FrequentNext(shards, layout)
    measured = intention_entry(predicted_intentions(network, read_shards(games, TEST), layout, frequent), layout)
    how = {"states": len(train), **partners_met(manifest), "settings": settings.stored(), "code revision": revision()}
    write_intentions(checkpoint, network.intentions, measured, how, out)
    return measured


def measured_intentions(
    network: PredictorNetwork,
    layout: Layout,
    target: Target,
    partners: Sequence[Partner],
    known: Sequence[Partner],
    plan: CollectionPlan,
) -> dict[str, Any]:
    """Measure a predictor's intentions in the target's games with `partners`, played again; the most frequent
    interactions (a baseline) are counted in one trajectory per setting with `known`. Raises ValueError without a
    decoder."""
    counted = CollectionPlan(1, plan.timesteps, plan.seed)
    frequent = FrequentNext([games_with(layout, target, partner, counted) for partner in known], layout)
    shards = [games_with(layout, target, partner, plan) for partner in partners]
    return intention_entry(predicted_intentions(network, shards, layout, frequent), layout)


def write_intentions(
    checkpoint: Checkpoint,
    decoder: IntentionDecoder,
    measured: Mapping[str, Any],
    how: Mapping[str, Any],
    out: Path,
) -> None:
    """Write the predictor's folder with this decoder in place of any other. All other tensors keep their bytes, and the
    decoder gets as many bits."""
    config = {**checkpoint.config, "intentions": asdict(decoder.config), "measured_intentions": dict(measured)}
    kept = {name: tensor for name, tensor in checkpoint.tensors.items() if not name.startswith(PREFIX)}
    added = {f"{PREFIX}{name}": tensor.numpy() for name, tensor in decoder.state_dict().items()}
    text = f"{checkpoint.card.partition(HEADING)[0].rstrip()}\n\n{section(measured, how)}"
    save_checkpoint(out, config, {**kept, **added}, text, bits=checkpoint.bits)


def section(measured: Mapping[str, Any], how: Mapping[str, Any]) -> str:
    """Return the card's section on intentions."""
    rows = (f"| {key} | {value} |" for key, value in how.items())
    return "\n".join([*figures(measured), "", HOW, "|---|---|", *rows])


def figures(measured: Mapping[str, Any]) -> list[str]:
    """Return the section's lines about accuracy, heading included."""
    columns = {
        "kind": "kind",
        "kind_and_station": "kind and station",
        "first_two": "it or the runner-up",
        "nearest_sensible": "nearest station that makes sense",
        "frequent": "most frequent for hand and pots",
        "when_error": "error of when (timesteps)",
        "states": "states",
    }
    rows = [
        f"| {int(timesteps) * SECONDS_OF_A_TIMESTEP:g} s | "
        + " | ".join("-" if values[key] is None else f"{values[key]:,}" for key in columns)
        + " |"
        for timesteps, values in measured["before"].items()
    ]
    return [
        HEADING,
        "",
        "A separate decoder on the tokens of all layers predicts the agent's next interaction within 20 timesteps",
        "(4 s), or none. The rest of the predictor is unchanged. Accuracy in % with the same unseen partners, by the",
        "time before the interaction:",
        "",
        f"| before | {' | '.join(columns.values())} |",
        f"|---|{'---|' * len(columns)}",
        *rows,
        "",
        f"All states: {measured['all_states']} % right (most frequent for hand and pots:",
        f"{measured['frequent']} %); of those without an interaction ({measured['none_share']} %):",
        f"{measured['none']} %. Expected calibration error: {measured['ece']:.3f}. Mean error of when:",
        f"{measured['when_error']} timesteps.",
    ]
