"""Read the offline accuracy (with unseen partners) from the cards of the predictors that were used. A card is found by
the predictor's hash in the export, never by its name. A predictor with errors added on purpose has the hash of the one
without them, but not its accuracy: it has no card.
"""

import hashlib
import json
from collections.abc import Mapping
from pathlib import Path

import polars as pl

from analysis.accuracy import degraded_to, predictors_of, with_predictor
from analysis.tables import STEPS, Export

Offline = dict[str, dict[str, dict[str, list[float]]]]  # agent -> predictor -> layout -> share right for every step


def known_offline(export: Export, weights: Path | None) -> Mapping[str, Mapping[str, object]]:
    """Return the offline accuracy (as `Offline`) from the export, otherwise from the cards. An export that names it
    does so by agent: it counts for the agent's only predictor without errors on purpose."""
    stored = export.about.get("offline_accuracy")
    if not isinstance(stored, Mapping):
        return offline_accuracy(export.episodes, weights) if weights else {}
    trained = {
        agent: [name for name in predictors_of(export.episodes, agent) if degraded_to(name) is None]
        for agent in export.agents
    }
    return {agent: {names[0]: stored.get(agent)} for agent, names in trained.items() if len(names) == 1}


def offline_accuracy(episodes: pl.DataFrame, weights: Path) -> Offline:
    """Return the accuracy for every agent, predictor and layout whose predictor is in `weights` (folders LAYOUT/NAME).
    Rounds of two people are left out: the offline test is about agents, which differ from people."""
    if "predictor_sha256" not in episodes.columns:
        return {}
    known = {hash_of(path.parent): steps for path in sorted(weights.glob("*/*/config.json")) if (steps := _steps(path))}
    found: Offline = {}
    if "watched_person" in episodes.columns:
        episodes = episodes.filter(pl.col("watched_person").is_null())
    used = with_predictor(episodes).select("agent", "predictor", "layout", "predictor_sha256").drop_nulls()
    for agent, predictor, layout, digest in used.unique(maintain_order=True).iter_rows():
        if digest in known and degraded_to(predictor) is None:
            found.setdefault(agent, {}).setdefault(predictor, {})[layout] = known[digest]
    return found


def hash_of(folder: Path) -> str:
    """Return the hash that identifies a checkpoint in data: the SHA-256 of its list of hashes."""
    sums = folder / "sha256"
    return hashlib.sha256(sums.read_bytes()).hexdigest() if sums.is_file() else ""


def _steps(config: Path) -> list[float] | None:
    try:
        accuracy = json.loads(config.read_text(encoding="utf-8"))["accuracy"]
        return [float(accuracy[f"step{step}"]) for step in range(1, STEPS + 1)]
    except (OSError, ValueError, KeyError, TypeError):
        return None
