"""`kitchenmind replay`: what it writes, and that it writes nothing for a wrong input."""

import gzip
import json
from pathlib import Path
from typing import Any

import pytest

import kitchenmind
from overcooked.layout import load_layout

EPISODES = Path(__file__).parent.parent / "data" / "episodes.jsonl.gz"
GOOD = {"layout": "coordination_ring", "joint_actions": [[3, 0], [5, 5], [4, 4]]}


def recorded_episodes(count: int) -> list[list[dict[str, Any]]]:
    episodes: list[list[dict[str, Any]]] = []
    with gzip.open(EPISODES, "rt") as lines:
        for line in map(json.loads, lines):
            if line["k"] == "ep":
                if len(episodes) == count:
                    break
                episodes.append([line])
            elif line["k"] == "s":
                episodes[-1].append(line)
    return episodes


def replay(tmp_path: Path, *lines: object) -> int:
    log = "".join((line if isinstance(line, str) else json.dumps(line)) + "\n" for line in lines)
    (tmp_path / "in.jsonl").write_text(log)
    return kitchenmind.main(["replay", str(tmp_path / "in.jsonl"), "--states", str(tmp_path / "out.jsonl")])


def test_recorded_episodes_replay_to_their_recorded_states_and_rewards(tmp_path: Path) -> None:
    episodes = recorded_episodes(3)
    lines = [
        {"layout": load_layout(start["layout"]).text, "joint_actions": [step["a"] for step in steps[:-1]]}
        for start, *steps in episodes
    ]
    assert replay(tmp_path, *lines) == 0
    written = [json.loads(line) for line in (tmp_path / "out.jsonl").read_text().splitlines()]
    assert len(written) == 3
    for (_, *steps), episode in zip(episodes, written, strict=True):
        keys = ("t", "p", "c", "pots", "crc")
        assert episode["states"] == [{key: step[key] for key in keys} for step in steps]
        assert episode["rewards"] == [step["r"] for step in steps[:-1]]
        assert episode["shaped"] == [step["sh"] for step in steps[:-1]]


def test_layout_may_be_a_name(tmp_path: Path) -> None:
    drawn = {**GOOD, "layout": load_layout("coordination_ring").text}
    assert replay(tmp_path, GOOD, drawn) == 0
    first, second = (tmp_path / "out.jsonl").read_text().splitlines()
    assert first == second
    assert len(json.loads(first)["states"]) == 4


def test_episode_without_actions_has_its_start(tmp_path: Path) -> None:
    assert replay(tmp_path, {**GOOD, "joint_actions": []}) == 0
    assert json.loads((tmp_path / "out.jsonl").read_text())["states"][0]["t"] == 0


@pytest.mark.parametrize(
    ("broken", "reason"),
    [
        ({**GOOD, "joint_actions": [[0, 0], [0, 6]]}, "joint action 1 is [0, 6]"),
        ({**GOOD, "joint_actions": [[0, -1]]}, "joint action 0 is [0, -1]"),
        ({**GOOD, "joint_actions": [[0, 0, 0]]}, "joint action 0 is [0, 0, 0]"),
        ({**GOOD, "joint_actions": [[True, 0]]}, "joint action 0 is [true, 0]"),
        ({**GOOD, "joint_actions": [["north", 0]]}, 'joint action 0 is ["north", 0]'),
        ({**GOOD, "joint_actions": [[1.0, 0]]}, "joint action 0 is [1.0, 0]"),
        ({**GOOD, "joint_actions": 7}, '"joint_actions" must be a list'),
        ({"layout": "coordination_ring"}, '"joint_actions" must be a list'),
        ({"joint_actions": []}, '"layout" must be a text'),
        ({**GOOD, "layout": "atlantis"}, "there is no layout 'atlantis'"),
        ({**GOOD, "layout": "x" * 5000}, "x"),
        ({**GOOD, "layout": "XXX\nX1\n"}, "row 2, column 3: the row has 2 cells"),
        ("[]", "a line is an object"),
        ("", "this is not JSON"),
        ('{"layout": "matrix", "joint', "this is not JSON"),
        ("[" * 100_000, "this is not JSON"),
    ],
)
def test_broken_line_is_refused_with_its_number_and_nothing_is_written(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], broken: object, reason: str
) -> None:
    assert replay(tmp_path, GOOD, broken, GOOD) == 2
    message = capsys.readouterr().err
    assert "in.jsonl, line 2: " in message
    assert reason in message
    assert [file.name for file in tmp_path.iterdir()] == ["in.jsonl"]


def test_broken_log_leaves_an_earlier_result_alone(tmp_path: Path) -> None:
    (tmp_path / "out.jsonl").write_text("earlier")
    assert replay(tmp_path, GOOD, "broken") == 2
    assert (tmp_path / "out.jsonl").read_text() == "earlier"


def test_bytes_that_are_not_text_are_refused(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "in.jsonl").write_bytes(b'{"layout": "\xff\xfe"}\n')
    assert kitchenmind.main(["replay", str(tmp_path / "in.jsonl"), "--states", str(tmp_path / "out.jsonl")]) == 2
    assert "line 1" in capsys.readouterr().err


def test_missing_log_and_missing_folder_are_refused(tmp_path: Path) -> None:
    assert kitchenmind.main(["replay", str(tmp_path / "none.jsonl"), "--states", str(tmp_path / "out.jsonl")]) == 2
    (tmp_path / "in.jsonl").write_text(json.dumps(GOOD))
    assert kitchenmind.main(["replay", str(tmp_path / "in.jsonl"), "--states", str(tmp_path / "no" / "out")]) == 2
    assert kitchenmind.main(["replay", str(tmp_path / "in.jsonl")]) == 2


def test_log_is_never_overwritten(tmp_path: Path) -> None:
    log = tmp_path / "in.jsonl"
    log.write_text(json.dumps(GOOD))
    assert kitchenmind.main(["replay", str(log), "--states", str(log)]) == 2
    assert json.loads(log.read_text()) == GOOD


def test_two_results_never_share_a_file(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "in.jsonl").write_text(json.dumps(GOOD))
    out = str(tmp_path / "out")
    assert kitchenmind.main(["replay", str(tmp_path / "in.jsonl"), "--states", out, "--trajectories", out]) == 2
    assert "give two names" in capsys.readouterr().err
    assert [file.name for file in tmp_path.iterdir()] == ["in.jsonl"]
