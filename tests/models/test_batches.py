"""Batches of waiting questions: nothing is mixed up or reordered."""

import numpy as np

from models.inference.batches import group_requests, merge_requests, split_answer
from models.inference.wire import Answer, ModelRequest, Row
from models.protocols import INTENTION, INTENTIONS, STEPS
from overcooked.constants import ACTIONS


def ask(number, layout, *games):
    rows = [Row(game, "sp", None, number, 1, False, 0, 0.5) for game in games]
    count = len(games)
    return ModelRequest(number, layout, rows, bytes([number] * count), bytes([number]), bytes([number] * 2 * count))


def test_a_game_never_comes_twice_in_a_group_and_its_frames_stay_in_order():
    asks = [
        ask(1, "ring", "a", "b"),
        ask(2, "matrix", "c"),
        ask(3, "ring", "d"),
        ask(4, "ring", "b"),
        ask(5, "ring", "a"),
    ]
    groups = [[one.id for one in group] for group in group_requests(asks)]
    assert sorted(groups) == [[1, 3], [2], [4, 5]]
    assert groups.index([1, 3]) < groups.index([4, 5])


def test_every_question_gets_its_own_rows_back():
    group = [ask(1, "ring", "a", "b"), ask(2, "ring", "c"), ask(3, "ring", "d", "e", "f")]
    whole = merge_requests(group)
    assert whole.players == bytes([1, 1, 2, 3, 3, 3])
    assert [row.key for row in whole.rows] == list("abcdef")
    action_distributions = np.arange(6 * ACTIONS, dtype=np.float32).reshape(6, ACTIONS)
    predictions = np.arange(6 * STEPS * ACTIONS, dtype=np.float32).reshape(6, STEPS, ACTIONS)
    intentions = np.zeros((6, INTENTIONS), INTENTION)
    intentions["x"] = np.arange(12).reshape(6, 2)
    answer = Answer(
        1,
        2.0,
        bytes(range(6)),
        action_distributions.tobytes(),
        bytes([1, 0, 1, 1, 0, 1]),
        predictions.tobytes(),
        intentions.tobytes(),
        ["broken"],
    )
    parts = list(split_answer(answer, group))
    assert [part.id for part in parts] == [1, 2, 3]
    assert [part.acted for part in parts] == [bytes([0, 1]), bytes([2]), bytes([3, 4, 5])]
    assert b"".join(part.action_distributions for part in parts) == action_distributions.tobytes()
    assert np.frombuffer(parts[1].predictions, np.float32).tolist() == predictions[2].ravel().tolist()
    assert np.frombuffer(parts[2].intentions, INTENTION)["x"].tolist() == [6, 7, 8, 9, 10, 11]
    assert [part.faults for part in parts] == [["broken"], [], []]
