# ruff: noqa: E501 (a table reads best with one wrong variant a line)
"""Mutation tests of the recordings: they detect each deliberately wrong variant of the rules.

A variant is the source text of `rules.py`, `score.py` or `observe.py` with one phrase changed, run without compilation.
"""

import gzip
import json
import zlib
from functools import cache
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

import overcooked
from overcooked.constants import EVENT_NAMES, HORIZON
from overcooked.layout import Layout, load_layout
from overcooked.state import Kitchens

SOURCES = Path(overcooked.__file__).parent
TRANSITIONS = Path(__file__).parent.parent / "data" / "transitions.jsonl.gz"
ENCODINGS_CHECKED = 1_500

WRONG = {
    "a soup of two onions cooks": ("rules", "        if inside == ONIONS_PER_SOUP:\n            contents", "        if 2 <= inside <= ONIONS_PER_SOUP:\n            contents"),
    "cooking starts a timestep late": ("rules", "= COOKING + 1", "= COOKING"),
    "cooking takes 19 timesteps": ("rules", "COOKING <= inside < READY:", "COOKING <= inside < READY - 1:"),
    "a soup burns": ("rules", "elif COOKING <= inside < READY:", "elif COOKING <= inside <= READY:"),
    "the second chef acts first": ("rules", "players, contents, 0, wanting_dish", "players, contents, 1, wanting_dish"),
    "an early pick-up from a cooking pot works": ("rules", "inside == READY:\n        contents", "inside > COOKING:\n        contents"),
    "an onion fits into a cooking pot": ("rules", "held == ONION and inside < ONIONS_PER_SOUP", "held == ONION and inside < READY"),
    "full hands swap with a counter": ("rules", "held != NOTHING and inside == NOTHING:", "held != NOTHING:"),
    "a dish can be delivered": ("rules", "tile == EXIT and held == SOUP", "tile == EXIT and held >= DISH"),
    "a full hand takes an onion": ("rules", "if tile == ONION_DISPENSER:\n        if held == NOTHING:", "if tile == ONION_DISPENSER:\n        if True:"),
    "chefs swap cells": ("rules", "not same_cell and not swapped", "not same_cell"),
    "chefs share a cell": ("rules", "not same_cell and not swapped", "not swapped"),
    "a wall is walked into": ("rules", "(to_x if is_free else x)", "to_x"),
    "a blocked chef does not turn": ("rules", "    players[0, FACING] = first_action if first_action < STAY else players[0, FACING]\n", ""),
    "the pots wanting a dish are counted after the first chef": ("rules", "        if second_action == INTERACT:\n", "        wanting_dish, full = _pots_at_start(pots, contents)\n        if second_action == INTERACT:\n"),
    "a dish on a counter does not matter": ("rules", " and not _dish_lies_on_counter(counters, contents)", ""),
    "the other's dish does not matter": ("rules", "1 if other_held == DISH else 0", "0"),
    "an empty pot wants a dish": ("rules", "if inside != 0 and inside != ONIONS_PER_SOUP:", "if inside != ONIONS_PER_SOUP:"),
    "a cooking pot is not full": ("rules", "if inside >= ONIONS_PER_SOUP:", "if inside == ONIONS_PER_SOUP:"),
    "a delivery pays 5": ("score", "DELIVERY_REWARD = 20", "DELIVERY_REWARD = 5"),
    "a soup from a counter is shaped": ("score", "events & SOUP_FROM_POT", "events & (1 << 11)"),
    "every dish is shaped": ("score", "events & USEFUL_DISH_PICKUP", "events & (1 << 7)"),
    "a placed onion is not shaped": ("score", "PLACEMENT_REWARD = 3", "PLACEMENT_REWARD = 0"),
    "the cooking plane counts up": ("observe", "COOK_TIME - (inside - COOKING)", "inside - COOKING"),
    "the urgent plane comes a timestep early": ("observe", "horizon - timestep[game] < URGENT", "horizon - timestep[game] <= URGENT"),
    "the two chefs' facings are exchanged": ("observe", "np.uint64(MY_FACING), np.uint64(OTHER_FACING)", "np.uint64(OTHER_FACING), np.uint64(MY_FACING)"),
    "a held object is drawn only for its holder": ("observe", "        _draw(out, others, held)\n", ""),
    "a soup in hand is not drawn as ready": ("observe", ", SOUP_READY: 1}", "}"),
}  # fmt: skip


@cache
def recordings() -> list[dict[str, Any]]:
    with gzip.open(TRANSITIONS, "rt") as lines:
        return [line for line in map(json.loads, lines) if line["k"] == "x"]


@cache
def layout(name: str) -> Layout:
    return load_layout(name)


def interpreted(module: str, right: str = "", wrong: str = "") -> SimpleNamespace:
    """The module's functions without compilation, after its one place that says `right` was made to say `wrong`."""
    text = (SOURCES / f"{module}.py").read_text()
    assert not right or text.count(right) == 1, f"{module}.py says {right!r} {text.count(right)} times"
    text = text.replace(right, wrong) if right else text
    text = "\n".join(line for line in text.split("\n") if not line.startswith("from overcooked.compiled"))
    names: dict[str, Any] = {"kernel": lambda function: function, "inlined_kernel": lambda function: function}
    names["__name__"] = f"wrong_{module}"
    exec(compile(text, f"{module}.py", "exec", dont_inherit=True), names)
    return SimpleNamespace(**names)


def differences(rules: Any, score: Any) -> int:
    """Recorded transitions (of those up to the first difference) that the variant gives otherwise."""
    events = np.zeros(2, np.int32)
    for line in recordings():
        kitchen = Kitchens.start(layout(line["layout"]))
        kitchen.restore(line)
        cells = kitchen.layout
        rules.step_game(
            cells.tiles, cells.pots, cells.counters, kitchen.players[0], kitchen.contents[0], *line["a"], events
        )
        kitchen.timestep += 1
        named = sorted([name, k] for k in (0, 1) for bit, name in enumerate(EVENT_NAMES) if events[k] >> bit & 1)
        rewards = (
            [score.sparse_reward(int(bits)) for bits in events],
            [score.shaped_reward(int(bits)) for bits in events],
        )
        if (named, *rewards) != (sorted(line["ev"]), line["r"], line["sh"]) or kitchen.record() != line["n"]:
            return 1
    return 0


def encoding_differences(observe: Any) -> int:
    """The same for the encoding, on the first recordings."""
    for line in recordings()[:: len(recordings()) // ENCODINGS_CHECKED]:
        kitchen = Kitchens.start(layout(line["layout"]))
        kitchen.restore(line)
        cells, out = kitchen.layout, np.empty_like(kitchen.encode())
        # Wide integers: without compilation numpy would let the small ones overflow.
        state = (array.astype(np.int64) for array in (cells.pots, cells.counters, kitchen.players, kitchen.contents))
        observe.encode(cells.static_views, *state, kitchen.timestep, HORIZON, out)
        if [zlib.crc32(view.tobytes()) for view in out[0]] != line["crc"]:
            return 1
    return 0


@pytest.mark.parametrize("name", WRONG)
def test_wrong_variant_is_caught(name: str) -> None:
    module, right, wrong = WRONG[name]
    variant = interpreted(module, right, wrong)
    if module == "observe":
        assert encoding_differences(variant) == 1
    elif module == "score":
        assert differences(interpreted("rules"), variant) == 1
    else:
        assert differences(variant, interpreted("score")) == 1


@pytest.mark.slow
def test_right_rules_pass_the_same_check() -> None:
    assert differences(interpreted("rules"), interpreted("score")) == 0
    assert encoding_differences(interpreted("observe")) == 0
