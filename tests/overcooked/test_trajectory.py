"""overcooked_ai's trajectory format: what we write has its shape, and comes back as the same episodes."""

import gzip
import json
from pathlib import Path
from typing import Any

import pytest

import kitchenmind
from overcooked.layout import load_layout
from overcooked.trajectory import TrajectoryError, read_trajectories, write_trajectories

EPISODES = Path(__file__).parent.parent / "data" / "episodes.jsonl.gz"


def first_recorded_episode() -> tuple[str, list[list[int]], list[dict[str, Any]]]:
    with gzip.open(EPISODES, "rt") as lines:
        steps: list[dict[str, Any]] = []
        for line in map(json.loads, lines):
            if line["k"] == "ep" and steps:
                break
            if line["k"] == "ep":
                name = line["layout"]
            elif line["k"] == "s":
                steps.append(line)
    return name, [step["a"] for step in steps[:-1]], steps


@pytest.fixture
def written(tmp_path: Path) -> Path:
    name, joint_actions, _ = first_recorded_episode()
    file = tmp_path / "ours.json"
    with file.open("w") as text:
        layouts = [load_layout(name), load_layout("coordination_ring")]
        assert write_trajectories([(layouts[0], joint_actions), (layouts[1], [[5, 0], [4, 3]])], text) == 2
    return file


def test_every_list_has_an_entry_an_episode_and_a_timestep(written: Path) -> None:
    columns = json.loads(written.read_text())
    assert {len(column) for column in columns.values()} == {2}
    for timesteps in ("ep_states", "ep_actions", "ep_rewards", "ep_dones"):
        assert [len(episode) for episode in columns[timesteps]] == columns["ep_lengths"] == [400, 2]
    assert columns["ep_actions"][1] == [["interact", [0, -1]], [[0, 0], [-1, 0]]]
    assert columns["ep_dones"][1] == [False, True]


def test_rewards_are_the_recorded_ones_of_the_team(written: Path) -> None:
    _, _, steps = first_recorded_episode()
    columns = json.loads(written.read_text())
    assert columns["ep_rewards"][0] == [sum(step["r"]) for step in steps[:-1]]
    assert columns["ep_returns"][0] == sum(columns["ep_rewards"][0])


def test_soups_carry_their_ingredients_and_clock(written: Path) -> None:
    _, _, steps = first_recorded_episode()
    states = json.loads(written.read_text())["ep_states"][0]
    soups = 0
    for step, state in zip(steps, states, strict=False):
        foreign = {tuple(thing["position"]): thing for thing in state["objects"]}
        for x, y, onions, tick in step["pots"]:
            soup = foreign[x, y]
            assert (soup["name"], len(soup["_ingredients"]), soup["_cooking_tick"]) == ("soup", onions, tick)
            assert (soup["is_idle"], soup["is_ready"]) == (tick < 0, tick == 20)
            soups += 1
        assert len(foreign) == len(step["pots"]) + len(step["c"])
    assert soups > 100


def test_written_trajectories_read_back_as_the_same_episodes(written: Path) -> None:
    name, joint_actions, _ = first_recorded_episode()
    (layout, actions), (ring, short) = read_trajectories(written)
    assert (layout.sha256, actions) == (load_layout(name).sha256, joint_actions)
    assert (ring.sha256, short) == (load_layout("coordination_ring").sha256, [[5, 0], [4, 3]])


def test_trajectory_of_a_known_layout_needs_no_terrain(written: Path) -> None:
    columns = json.loads(written.read_text())
    for parameters in columns["mdp_params"]:
        del parameters["terrain"], parameters["start_player_positions"]
    written.write_text(json.dumps(columns))
    assert len(list(read_trajectories(written))) == 2


def test_state_that_does_not_follow_is_refused_with_its_timestep(written: Path) -> None:
    columns = json.loads(written.read_text())
    columns["ep_states"][1][1]["players"][0]["position"] = [3, 3]
    written.write_text(json.dumps(columns))
    with pytest.raises(TrajectoryError, match=r"episode 1 .* timestep 1"):
        list(read_trajectories(written))


@pytest.mark.parametrize("text", ["", "[]", "{}", '{"ep_states": [[]], "ep_actions": [], "mdp_params": [{}]}'])
def test_other_files_are_refused(tmp_path: Path, text: str) -> None:
    file = tmp_path / "other.json"
    file.write_text(text)
    with pytest.raises(TrajectoryError, match=r"other\.json"):
        list(read_trajectories(file))


def in_older_form(columns: dict[str, Any]) -> dict[str, Any]:
    """As overcooked_ai wrote trajectories in 2019: a soup's state is [kind, onions, tick], states have no timestep."""
    for states in columns["ep_states"]:
        for state in states:
            del state["timestep"], state["bonus_orders"], state["all_orders"]
            held = [player["held_object"] for player in state["players"] if player["held_object"]]
            for thing in [*state["objects"], *held]:
                onions, tick = len(thing.get("_ingredients", ())), max(0, thing.get("_cooking_tick", 0))
                keep = {"name": thing["name"], "position": thing["position"]}
                thing.clear()
                thing.update(keep, state=["onion", onions, tick] if keep["name"] == "soup" else None)
    for parameters in columns["mdp_params"]:
        layout = parameters["layout_name"]
        parameters.clear()
        parameters.update(layout_name=layout, cook_time=20, num_items_for_soup=3, start_order_list=None)
    return {("ep_observations" if name == "ep_states" else name): column for name, column in columns.items()}


def test_trajectories_of_the_older_form_are_the_same_episodes(written: Path) -> None:
    expected = [(layout.sha256, actions) for layout, actions in read_trajectories(written)]
    columns = in_older_form(json.loads(written.read_text()))
    written.write_text(json.dumps(columns))
    assert [(layout.sha256, actions) for layout, actions in read_trajectories(written)] == expected


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (lambda old: old["mdp_params"][0].update(cook_time=5), "cook_time is 5 there and 20 in these rules"),
        (lambda old: old["ep_observations"][0].__setitem__(0, [[0.0]]), "what a network saw .* .jsonl file"),
        (
            lambda old: old["ep_observations"][1][1]["players"][0].update(position=[3, 3]),
            "episode 1 .* timestep 1 does not follow",
        ),
    ],
)
def test_older_trajectories_of_other_rules_are_refused_with_what_differs(
    written: Path, change: Any, words: str
) -> None:
    columns = in_older_form(json.loads(written.read_text()))
    change(columns)
    written.write_text(json.dumps(columns))
    with pytest.raises(TrajectoryError, match=words):
        list(read_trajectories(written))


def test_layout_name_of_a_trajectory_is_not_a_path(written: Path, tmp_path: Path) -> None:
    (tmp_path / "other.layout").write_text(load_layout("coordination_ring").text)
    columns = json.loads(written.read_text())
    for parameters in columns["mdp_params"]:
        del parameters["terrain"], parameters["start_player_positions"]
        parameters["layout_name"] = str(tmp_path / "other.layout")
    written.write_text(json.dumps(columns))
    with pytest.raises(TrajectoryError, match="there is no layout"):
        list(read_trajectories(written))


def test_unknown_actions_are_refused(written: Path) -> None:
    columns = json.loads(written.read_text())
    columns["ep_actions"][1][0][0] = "jump"
    written.write_text(json.dumps(columns))
    with pytest.raises(TrajectoryError, match="jump"):
        list(read_trajectories(written))


def test_command_line_turns_one_format_into_the_other(written: Path, tmp_path: Path) -> None:
    states, again = tmp_path / "states.jsonl", tmp_path / "again.json"
    assert kitchenmind.main(["replay", str(written), "--states", str(states), "--trajectories", str(again)]) == 0
    assert len(states.read_text().splitlines()) == 2
    first, second = json.loads(written.read_text()), json.loads(again.read_text())
    for column in ("ep_states", "ep_actions", "ep_rewards", "ep_returns"):
        assert first[column] == second[column]


def test_broken_trajectories_leave_exit_status_2_and_no_file(tmp_path: Path) -> None:
    (tmp_path / "other.json").write_text("{}")
    assert kitchenmind.main(["replay", str(tmp_path / "other.json"), "--states", str(tmp_path / "out.jsonl")]) == 2
    assert [file.name for file in tmp_path.iterdir()] == ["other.json"]


@pytest.mark.parametrize(
    ("change", "problem"),
    [
        (lambda columns: columns["ep_actions"][0].pop(), "states and .* joint actions; each state needs one"),
        (lambda columns: columns["ep_states"].__setitem__(0, None), "a part is missing or damaged .* Copy or write"),
        (lambda columns: columns["ep_actions"][0].__setitem__(3, "up"), "'u' is not an action; actions are "),
    ],
)
def test_damaged_trajectories_are_refused_in_plain_words(written: Path, change, problem: str) -> None:
    columns = json.loads(written.read_text())
    change(columns)
    written.write_text(json.dumps(columns))
    with pytest.raises(TrajectoryError, match=problem):
        list(read_trajectories(written))


@pytest.mark.parametrize("name", ["empty.jsonl", "only_a_layout.jsonl"])
def test_a_file_without_episodes_is_refused(tmp_path: Path, name: str) -> None:
    line = '{"k": "layout", "name": "small", "grid": ["XPXX", "O12O", "XDSX"]}\n'
    (tmp_path / name).write_text("" if name.startswith("empty") else line)
    command = ["replay", str(tmp_path / name), "--states", str(tmp_path / "out.jsonl")]
    assert kitchenmind.main(command) == 2
    assert not (tmp_path / "out.jsonl").exists()
