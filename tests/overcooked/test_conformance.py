"""The engine against recordings of the reference kitchen: every state, reward, event and encoding, bit for bit."""

import gzip
import json
import zlib
from collections.abc import Iterator
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from overcooked.constants import EVENT_NAMES
from overcooked.layout import Layout, layout_names, load_layout, parse_layout
from overcooked.score import shaped_reward, sparse_reward
from overcooked.state import Kitchens

DATA = Path(__file__).parent.parent / "data"
SOUP_REWARD_OF_2019 = 5
GAMES_OF_PEOPLE = {  # joint steps of the recorded games
    "asymmetric_advantages_train": 10_768,
    "coordination_ring_train": 9_619,
    "counter_circuit_train": 9_627,
    "cramped_room_train": 9_564,
    "forced_coordination_train": 7_151,
}
Recorded = dict[str, Any]


@cache
def recorded(name: str) -> tuple[Recorded, ...]:
    with gzip.open(DATA / f"{name}.jsonl.gz", "rt") as lines:
        return tuple(map(json.loads, lines))


@cache
def layouts_of(name: str) -> dict[str, Layout]:
    return {line["name"]: parse_layout("\n".join(line["grid"])) for line in recorded(name) if line["k"] == "layout"}


def episodes(name: str) -> Iterator[tuple[Layout, list[Recorded]]]:
    layout, steps = None, []
    for line in recorded(name):
        if line["k"] == "s":
            steps.append(line)
        elif line["k"] == "ep":
            if layout is not None:
                yield layout, steps
            layout, steps = layouts_of(name)[line["layout"]], []
    assert layout is not None
    yield layout, steps


def state_of(line: Recorded) -> Recorded:
    return {key: line[key] for key in ("t", "p", "c", "pots")}


def encoding_crcs(kitchen: Kitchens) -> list[int]:
    return [zlib.crc32(view.tobytes()) for view in kitchen.encode()[0]]


def events_of(bits: np.ndarray) -> list[list[Any]]:
    return sorted([name, player] for player in (0, 1) for k, name in enumerate(EVENT_NAMES) if bits[player] >> k & 1)


def check_transition(kitchen: Kitchens, line: Recorded) -> None:
    """Step the kitchen and compare what the recording says of the joint action."""
    events = np.zeros((1, 2), np.int32)
    kitchen.step(np.array([line["a"]]), events)
    assert [sparse_reward(int(bits)) for bits in events[0]] == line["r"]
    assert [shaped_reward(int(bits)) for bits in events[0]] == line["sh"]
    assert events_of(events[0]) == sorted(line["ev"])


def test_recorded_layouts_are_the_bundled_ones_of_that_name() -> None:
    recorded_layouts = layouts_of("episodes")
    of_people = {name.removesuffix("_train") for name in GAMES_OF_PEOPLE}
    assert set(recorded_layouts) | of_people == set(layout_names()) - {"practice"}
    assert all(load_layout(name).sha256 == layout.sha256 for name, layout in recorded_layouts.items())


def test_recorded_episodes_are_reproduced_bit_for_bit() -> None:
    transitions = deliveries = count = 0
    for layout, steps in episodes("episodes"):
        kitchen = Kitchens.start(layout)
        count += 1
        for line in steps:
            assert kitchen.record() == state_of(line)
            assert encoding_crcs(kitchen) == line["crc"]
            if "a" in line:
                check_transition(kitchen, line)
                transitions += 1
                deliveries += sum(name == "soup_delivery" for name, _ in line["ev"])
    assert (count, transitions, deliveries) == (60, 24_000, 249)


def test_recorded_single_transitions_are_reproduced_bit_for_bit() -> None:
    count = 0
    for line in recorded("transitions"):
        if line["k"] != "x":
            continue
        kitchen = Kitchens.start(layouts_of("transitions")[line["layout"]])
        kitchen.restore(line)
        assert kitchen.record() == state_of(line)
        assert encoding_crcs(kitchen) == line["crc"]
        check_transition(kitchen, line)
        assert kitchen.record() == line["n"]
        count += 1
    assert count == 7_500


@pytest.mark.parametrize(("name", "joint_steps"), GAMES_OF_PEOPLE.items())
def test_recorded_games_of_people_replay(name: str, joint_steps: int) -> None:
    events, steps_played = np.zeros((1, 2), np.int32), 0
    assert load_layout(name.removesuffix("_train")).sha256 == layouts_of(name)[name.removesuffix("_train")].sha256
    for layout, steps in episodes(name):
        kitchen = Kitchens.start(layout)
        for line in steps:
            assert kitchen.record() == state_of(line)
            kitchen.step(np.array([line["a"]]), events)
            soups = sum(sparse_reward(int(bits)) for bits in events[0]) / 20
            assert soups * SOUP_REWARD_OF_2019 == line["r"]
            steps_played += 1
    assert steps_played == joint_steps


@pytest.mark.parametrize("games", [1, 7])
def test_many_games_step_like_one(games: int) -> None:
    layout, steps = next(iter(episodes("episodes")))
    many, one = Kitchens.start(layout, games), Kitchens.start(layout)
    many_events, one_events = np.zeros((games, 2), np.int32), np.zeros((1, 2), np.int32)
    for line in steps[:-1]:
        many.step(np.tile(line["a"], (games, 1)), many_events)
        one.step(np.array([line["a"]]), one_events)
    assert (many_events == one_events).all()
    assert (many.encode() == one.encode()).all()
    assert {many.hash(game) for game in range(games)} == {one.hash()}
