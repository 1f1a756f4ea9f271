"""Choosing the FCP run for studies, and the snapshots of its skill levels."""

from pathlib import Path
from types import SimpleNamespace
from typing import cast

import pytest

from training.choose_agents import best_fcp
from training.runlog import RunFolder
from training.train_agent import skill_snapshot

SCORES = {
    "strong": {"self_play": 200.0, "held_out": 90.0},
    "kind": {"self_play": 120.0, "held_out": 110.0},
    "weak": {"self_play": 20.0, "held_out": 130.0},
}


@pytest.mark.parametrize(
    ("of_sp", "best"),
    [(200.0, "kind"), (400.0, "strong"), (40.0, "weak"), (0.0, "weak")],
    ids=["half of SP is enough", "nobody reaches half", "all reach half", "SP never served a soup"],
)
def test_best_with_unseen_partners_among_those_that_can_cook(of_sp: float, best: str) -> None:
    assert best_fcp(SCORES, of_sp) == best


def test_a_skill_level_is_a_snapshot_before_the_best_one() -> None:
    rewards = [5.0, 40.0, 100.0, 35.0]  # the last one has become worse; it is not half trained
    snapshots = [(number, reward, Path(str(number))) for number, reward in enumerate(rewards)]
    folder = cast(RunFolder, SimpleNamespace(snapshots=lambda: snapshots))
    assert [skill_snapshot(folder, skill)[0] for skill in (5, 35, 70, 100)] == [0, 1, 1, 2]
