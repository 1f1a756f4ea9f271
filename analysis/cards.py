"""Read the offline accuracy (with unseen partners) from the cards of the predictors that were used. A card is found by
the predictor's hash in the export, never by its name.
"""

import hashlib
import json
from pathlib import Path

import polars as pl

from analysis.tables import STEPS

Offline = dict[str, dict[str, list[float]]]  # agent -> layout -> share of right actions for every step


def offline_accuracy(episodes: pl.DataFrame, weights: Path) -> Offline:
    """For every agent and layout whose predictor lies in `weights` (folders LAYOUT/NAME); others are left out."""
    if "predictor_sha256" not in episodes.columns:
        return {}
    known = {hash_of(path.parent): steps for path in sorted(weights.glob("*/*/config.json")) if (steps := _steps(path))}
    found: Offline = {}
    used = episodes.select("agent", "layout", "predictor_sha256").drop_nulls().unique(maintain_order=True)
    for agent, layout, digest in used.iter_rows():
        if digest in known:
            found.setdefault(agent, {})[layout] = known[digest]
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
