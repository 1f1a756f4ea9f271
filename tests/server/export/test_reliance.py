"""What people do next to shown cells, counted by hand."""

import pytest
from msgspec import structs

from overcooked.constants import EAST, INTERACT, NORTH, SOUTH, STAY, WEST
from server.export.reliance import counted, response, responses
from server.play.recorder import TickRecord
from tests.support.live_fakes import make_spec

ROOM = """
XXXXXXX
O 1 2 P
X     D
XXXXSXX
""".strip()
SPEC = make_spec(grid=ROOM, layout="room")
AHEAD = ((WEST, 95), (STAY, 80), (SOUTH, 60))  # of the chef in column 4: to the cells (3, 1) and (3, 2)
NOTHING = ((6, 95), (6, 80), (6, 60))


@pytest.mark.parametrize(
    ("there", "action", "word"),
    [((2, 1), STAY, "waited"), ((2, 1), INTERACT, "used"), ((3, 1), EAST, "followed"), ((1, 1), WEST, "avoided")],
)
def test_responses_next_to_a_shown_cell(there: tuple[int, int], action: int, word: str) -> None:
    assert response({(3, 1)}, (2, 1), there, action) == word
    assert response({(5, 2)}, (2, 1), there, action) == "", "too far away"
    assert response(set(), (2, 1), there, action) == ""


def tick(timestep: int, displayed: tuple[tuple[int, int], ...], action: int | None, wrong: bool | None) -> TickRecord:
    """The state of `timestep`, which the person's `action` led to."""
    actions = None if action is None else (action, STAY)
    fields = {"rewards": (0, 0), "shaped": (0, 0), "events": (0, 0), "next_actions": (None, STAY), "prediction": ()}
    times = {"scheduled_ms": 0.0, "late_ms": 0.0, "models_ms": 0.0, "late": False}
    return TickRecord(
        episode="e1", timestep=timestep, actions=actions, state_hash="", displayed=displayed, keys=(), misleading=wrong,
        **fields, **times,
    )  # type: ignore[arg-type]  # fmt: skip


def test_responses_are_counted_before_and_after_the_first_wrong_mark() -> None:
    records = [
        tick(0, AHEAD, None, None),
        tick(1, AHEAD, STAY, False),  # waited next to (3, 1)
        tick(2, AHEAD, WEST, True),  # avoided: walked away to (1, 1)
        tick(3, NOTHING, EAST, True),  # back to (2, 1), too far from (3, 1) before it
        tick(4, AHEAD, EAST, True),  # nothing was shown
    ]
    words = [word for _, word in responses(SPEC, records)]
    assert words == ["waited", "avoided", "", ""]
    first_wrong = [tick(0, AHEAD, None, True), *records[1:]]
    assert dict(counted(SPEC, first_wrong, was_misled=False)[0]["before"]) == {"waited": 1}
    assert dict(counted(SPEC, first_wrong, was_misled=False)[0]["after"]) == {"avoided": 1}
    phases, misled = counted(SPEC, records, was_misled=False)
    assert misled
    assert (dict(phases["before"]), dict(phases["after"])) == ({"waited": 1, "avoided": 1}, {})
    phases, _ = counted(SPEC, records, was_misled=True)
    assert (dict(phases["before"]), dict(phases["after"])) == ({}, {"waited": 1, "avoided": 1})


def test_wrong_marks_that_nobody_saw_mislead_nobody() -> None:
    records = [tick(0, NOTHING, None, True), tick(1, NOTHING, NORTH, True)]
    assert not counted(SPEC, records, was_misled=False)[1]


def test_a_wrong_intention_that_was_drawn_misleads_like_an_action() -> None:
    seen = structs.replace(tick(0, NOTHING, None, True), displayed_intention=(4, 3, 0, 95))
    assert counted(SPEC, [seen, tick(1, NOTHING, NORTH, True)], was_misled=False)[1]
    hidden = structs.replace(seen, displayed_intention=(8, -1, -1, 95))
    assert not counted(SPEC, [hidden, tick(1, NOTHING, NORTH, True)], was_misled=False)[1]
