"""Choosing the FCP run for studies."""

import pytest

from training.choose import best_fcp

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
