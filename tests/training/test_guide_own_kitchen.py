"""The guide for own kitchens works to its end: all agents of a new kitchen, trained by its command, play in a study.
With a preset that makes everything small; the rest of the guide is run by `test_guides.py`.
"""

import re
from pathlib import Path

import pytest

from tests.support import guide_checkout

GUIDE = (guide_checkout.ROOT / "docs" / "guides" / "bring_your_own_kitchen.md").read_text(encoding="utf-8")
LAST = GUIDE.partition("## The full set of agents and predictors")[2]
ROLES = ("population_sp", "target_sp", "population_fcp", "target_fcp", "features")
AGENT = "timesteps = 12_800\ngames = 16\nsnapshots = 4\nself_play_games = 8\nimitation_updates = 120\n"
PREDICTOR = "updates = 20\nwarm_up = 5\ncheck_every = 10\nhidden = 32\nheads = 2\nlayers = 2\n"
SHORTER = {"kitchenmind train study": "--preset small.toml", "kitchenmind bots": "--database sqlite:///own.sqlite3"}


@pytest.fixture
def checkout(tmp_path: Path) -> Path:
    """With the guide's drawing next to the bundled ones, without any weights."""
    made = guide_checkout.build(tmp_path)
    drawing = re.search(r"^```text nook.layout\n(.*?)^```$", GUIDE, re.MULTILINE | re.DOTALL)
    assert drawing is not None
    (made / "overcooked" / "layouts" / "nook.layout").write_text(drawing[1], encoding="utf-8")
    tables = "".join(f"[{role}]\n{AGENT}" for role in ROLES)
    preset = f"population = 2\ntargets = 1\n{tables}network = 'cnn'\n[predictor]\n{PREDICTOR}"
    (made / "small.toml").write_text(preset, encoding="utf-8")
    return made


def done(line: str, checkout: Path) -> str:
    return guide_checkout.done(line, checkout, SHORTER, within_s=1500)


def study(text: str) -> str:
    """A study file with the kitchen, the agents and the predictor that the guide's last words name."""
    kitchen, sp, fcp = re.findall(r"`(\{name: [^`]+\})`", LAST)
    (predictor,) = re.findall(r"`(predictor: tom)`", LAST)
    wanted = {
        "layouts": f"  - {kitchen.replace('...', 'The nook')}\n",
        "agents": f"  - {sp}\n  - {fcp}\n",
        "conditions": f"  - {{name: tom, {predictor}}}\n",
        "game": "  horizon: 30\n",
    }
    for key, value in wanted.items():
        text = re.sub(rf"^{key}:.*\n(?:[ #-].*\n|\n)*", "", text, flags=re.MULTILINE)
        text += f"\n{key}:\n{value}"
    return text


@pytest.mark.slow
@pytest.mark.timeout(1800)
def test_the_commands_of_the_guide_train_all_agents_of_an_own_kitchen(checkout: Path) -> None:
    block = re.search(r"^```\n(.*?)^```$", LAST, re.MULTILINE | re.DOTALL)
    assert block is not None
    plan, train = block[1].splitlines()
    assert "0 of 20 tasks done" in done(plan, checkout)
    assert "20 of 20 tasks done" in done(train, checkout)
    weights = checkout / "models" / "weights" / "nook"
    cards = {card.parent.name for card in weights.glob("*/card.md")}
    assert {"sp", "fcp", "sp_predictor_stream", "fcp_predictor_stream"} <= cards
    done("kitchenmind study new own --out own.yaml", checkout)
    (checkout / "own.yaml").write_text(study((checkout / "own.yaml").read_text(encoding="utf-8")), encoding="utf-8")
    assert "no trained" not in done("kitchenmind study check own.yaml", checkout)
    done("kitchenmind bots 1 --study own.yaml --fast", checkout)
    done("kitchenmind verify --database sqlite:///own.sqlite3", checkout)
