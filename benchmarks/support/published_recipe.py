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


def agents() -> list[dict[str, Any]]:
    """Return the points of each chosen agent: layout, agent, self_play, held_out (of FCP)."""
    paths = sorted(KEPT.glob("*/choose_*/decision.json"))
    return [json.loads(path.read_text(encoding="utf-8"))["measured"] for path in paths]
