"""Recorded games of people: read line by line, compared with the rules, refused with the line and the remedy."""

import gzip
import json
from pathlib import Path
from typing import Any

import pytest

from overcooked.replay import ReplayError, read_episodes

DATA = Path(__file__).parent.parent / "data"
PEOPLE = DATA / "forced_coordination_train.jsonl.gz"


@pytest.fixture
def lines() -> list[dict[str, Any]]:
    """The first 40 timesteps of a game of two people."""
    with gzip.open(PEOPLE, "rt") as file:
        return [json.loads(file.readline()) for _ in range(42)]


def read(folder: Path, lines: list[dict[str, Any]]) -> list[tuple[str, int]]:
    file = folder / "people.jsonl"
    file.write_text("".join(json.dumps(line) + "\n" for line in lines))
    return [(episode.layout.name, len(episode.joint_actions)) for episode in read_episodes(file)]


def test_all_games_of_people_follow_from_the_rules() -> None:
    with gzip.open(PEOPLE, "rt") as file:
        lengths = [one["steps"] for one in map(json.loads, file) if one["k"] == "ep"]
    assert [len(episode.joint_actions) for episode in read_episodes(PEOPLE)] == lengths


def test_a_last_state_without_an_action_ends_an_episode(tmp_path: Path, lines: list[dict[str, Any]]) -> None:
    del lines[-1]["a"]
    assert read(tmp_path, lines) == [("forced_coordination", 39)]


def test_a_state_that_does_not_follow_is_refused_with_line_and_remedy(
    tmp_path: Path, lines: list[dict[str, Any]]
) -> None:
    lines[30]["p"][0][0] += 1
    with pytest.raises(ReplayError, match=r"line 31: the state of timestep 28 .* old dynamics.*write them"):
        read(tmp_path, lines)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (lambda lines: lines[5].update(a=[7, 0]), 'line 6: "a" is'),
        (lambda lines: lines[5].pop("p"), "line 6: the line 's' is incomplete"),
        (lambda lines: lines[1].update(k="x"), 'line 2: "k" is'),
        (lambda lines: lines.pop(1), "line 2: a state comes before its episode"),
        (lambda lines: lines[5].pop("a"), "line 7: a state follows a state without an action"),
    ],
)
def test_lines_that_are_not_a_recorded_game_are_refused(
    tmp_path: Path, lines: list[dict[str, Any]], change: Any, words: str
) -> None:
    change(lines)
    with pytest.raises(ReplayError, match=words):
        read(tmp_path, lines)


def test_a_packed_file_that_is_cut_off_is_refused(tmp_path: Path) -> None:
    file = tmp_path / "cut.jsonl.gz"
    file.write_bytes(PEOPLE.read_bytes()[:5000])
    with pytest.raises(ReplayError, match=r"cut.jsonl.gz.* Copy it again"):
        list(read_episodes(file))
