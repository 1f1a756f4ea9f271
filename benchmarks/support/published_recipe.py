"""What `kitchenmind train study --preset published` has finished so far, from the folders that `--keep` wrote."""

import json
from pathlib import Path
from typing import Any, Final

KEPT: Final = Path(__file__).resolve().parents[2] / "training" / "kept" / "published"
WORDS: Final = (
    "The published recipe (preset `published`: reward alone, 10 million timesteps an agent, only the paper's 31",
    "partners), as far as it is trained. These agents and predictors are not bundled yet. Accuracy with test partners",
    "(%, mean of the three steps), and points in 400 timesteps; a dash: not trained yet.",
)


def predictors() -> list[dict[str, Any]]:
    """Return the figures on the cards of the finished predictors: layout, agent, form, accuracy."""
    paths = sorted(KEPT.glob("*/predictor_*/predictor/config.json"))
    return [json.loads(path.read_text(encoding="utf-8"))["measured"] for path in paths]


def points() -> dict[tuple[str, str], str]:
    """Return the points of each chosen agent with itself, by layout and agent."""
    found = {}
    for path in sorted(KEPT.glob("*/choose_*/decision.json")):
        measured = json.loads(path.read_text(encoding="utf-8"))["measured"]
        own = measured["self_play"]
        found[measured["layout"], measured["agent"]] = f"{own['mean']:.0f} ± {own['se']:.0f}"
    return found
