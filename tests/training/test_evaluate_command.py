"""The output of `kitchenmind evaluate ... --json`, on which scripts may rely: exactly these keys, in percent."""

import json

import pytest

import kitchenmind
from models.agents.catalogue import WEIGHTS, agent_set
from models.networks.checkpoint import load_checkpoint, save_checkpoint
from training.pipeline.agent_tasks import STUDY_LAYOUTS

LAYOUT = STUDY_LAYOUTS[0]
CELLS = sorted((LAYOUT, agent) for agent in ("sp", "fcp", "sp_strong", "fcp_strong"))
SHORT = ("--trajectories", "1", "--timesteps", "40")
MEAN = {"mean": float, "se": float}
AGENT = {"layout": str, "agent": str, "self_play": MEAN, "held_out": MEAN, "episodes": int, "agent_set": str}
WITH_PARTNER = {
    "layout": str,
    "agent": str,
    "self_play": MEAN,
    "partner": str,
    "with_partner": {**MEAN, "seats": list},
    "episodes": int,
    "agent_set": str,
}
PREDICTOR = {
    "layout": str,
    "agent": str,
    "form": str,
    "accuracy": {"step1": float, "step2": float, "step3": float, "mean": float},
    "ceiling_step1": float,
    "baselines": {"repeat": float, "frequent": float},
    "not_stuck": {"mean": float},
    "ece": float,
    "windows": int,
    "agent_set": str,
}


def kinds(value):
    """The types of everything in it."""
    return {key: kinds(item) for key, item in value.items()} if isinstance(value, dict) else type(value)


def test_the_set_of_an_agent_is_published_where_the_kitchen_also_has_a_strong_one(tmp_path, monkeypatch):
    monkeypatch.setattr("models.agents.catalogue.WEIGHTS", tmp_path)
    for name in ("ring/sp", "ring/sp_strong", "room/sp"):
        (tmp_path / name).mkdir(parents=True)
    agents = (("ring", "sp"), ("ring", "sp_strong"), ("room", "sp"))
    assert [agent_set(name, layout)["agent_set"] for layout, name in agents] == ["published", "strong", "strong"]
    assert agent_set("planner", "ring") == {}


def printed(capsys, *words):
    assert kitchenmind.main(["evaluate", *words, "--json"]) == 0
    return json.loads(capsys.readouterr().out)


@pytest.mark.slow
def test_agents_are_a_list_of_points_with_themselves_and_with_unseen_partners(capsys):
    entries = printed(capsys, "agents", "--layouts", LAYOUT, "--episodes", "1", "--timesteps", "20")
    assert [kinds(entry) for entry in entries] == [AGENT] * len(entries)
    assert sorted((entry["layout"], entry["agent"]) for entry in entries) == CELLS
    assert all(entry["episodes"] == 1 for entry in entries)


def test_agents_with_one_partner_are_a_list_of_points_in_both_seats(capsys):
    short = ("--episodes", "2", "--timesteps", "60", "--partner", "human_bc")
    entries = printed(capsys, "agents", "--layouts", "random1", *short)
    assert [kinds(entry) for entry in entries] == [WITH_PARTNER] * len(entries)
    assert sorted((entry["layout"], entry["agent"]) for entry in entries) == CELLS
    for entry in entries:
        both, seats = entry["with_partner"], entry["with_partner"]["seats"]
        assert [kinds(seat) for seat in seats] == [MEAN] * 2
        assert both["mean"] == pytest.approx((seats[0]["mean"] + seats[1]["mean"]) / 2, abs=0.1)
    assert kitchenmind.main(["evaluate", "agents", "--layouts", "random1", *short]) == 0
    table = capsys.readouterr().out
    assert "with human_bc" in table
    assert table.count("as chef 2") == len(entries)


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["--partner", "human_cb"], "no layout has an agent 'human_cb'. Known: carrier, fcp,"),
        (["--partner", "./mine.onnx"], "./mine.onnx: say for which layouts: --layouts NAME."),
        (["--partner", "human_bc", "--layouts", "matrix"], "no agent 'human_bc' for matrix. Known: planner,"),
    ],
)
def test_a_partner_that_cannot_be_met_is_refused(capsys, words, said):
    assert kitchenmind.main(["evaluate", "agents", "--episodes", "1", "--timesteps", "5", *words]) == 2
    assert said in capsys.readouterr().err


BEFORE = {
    "states": int, "kind": float, "kind_and_station": float, "first_two": float, "nearest_sensible": float,
    "frequent": float, "when_error": float,
}  # fmt: skip


@pytest.mark.slow
def test_intentions_are_compared_with_two_baselines(capsys):
    words = ["predictor", "--layout", LAYOUT, "--agent", "sp", "--trajectories", "1", "--timesteps", "100"]
    entry, other = sorted(printed(capsys, *words, "--intentions"), key=lambda one: str(one["form"]))
    assert (entry["form"], other["form"]) == ("stream", "window")
    assert kinds({key: value for key, value in entry.items() if key != "intentions"}) == PREDICTOR
    measured = entry["intentions"]
    assert set(measured["before"]) == {"5", "10", "20"}
    assert kinds(measured["before"]["5"]) == BEFORE
    assert measured["before"]["5"]["kind_and_station"] > 80
    assert measured["all_states"] > measured["frequent"]
    assert kitchenmind.main(["evaluate", *words, "--intentions"]) == 0
    assert "1 s before:" in capsys.readouterr().out


def test_a_predictor_is_not_measured_with_another_agent_that_has_the_name_of_its_own(tmp_path, capsys):
    found = load_checkpoint(WEIGHTS / LAYOUT / "fcp_predictor_stream")
    save_checkpoint(tmp_path / "p", {**found.config, "agent": "sp"}, found.tensors, found.card, found.bits)
    words = ["predictor", "--layout", LAYOUT, "--predictor", str(tmp_path / "p"), *SHORT]
    assert kitchenmind.main(["evaluate", *words]) == 2
    assert "predicts another agent than sp. Say which: --agent." in capsys.readouterr().err
    (entry,) = printed(capsys, *words, "--agent", "fcp")
    assert (entry["agent"], entry["form"]) == ("fcp", "stream")
    assert kitchenmind.main(["evaluate", *words, "--agent", "planner"]) == 0
    assert "was trained to predict another agent than planner." in capsys.readouterr().err


def test_predictors_are_a_list_of_accuracies_with_ceiling_and_baselines(capsys):
    entries = printed(capsys, "predictor", "--layout", LAYOUT, "--trajectories", "1", "--timesteps", "40")
    assert [kinds(entry) for entry in entries] == [PREDICTOR] * len(entries)
    assert sorted((entry["layout"], entry["agent"]) for entry in entries if entry["form"] == "stream") == CELLS
    for entry in entries:
        steps = [entry["accuracy"][key] for key in ("step1", "step2", "step3")]
        assert entry["accuracy"]["mean"] == pytest.approx(sum(steps) / 3, abs=0.02)
        assert 50 < entry["accuracy"]["mean"] <= 100
        assert 0 <= entry["ece"] < 1
        assert entry["windows"] % (4 * 40) == 0
