"""Collected games: both seats, all partners, the stored arrays, and what is not mixed in."""

import json

import numpy as np
import pytest
import torch

from models.agents.catalogue import load_agent
from models.networks.config import NetworkConfig
from models.networks.policy import build_network, save_agent
from models.protocols import Mode
from overcooked.state import Kitchens
from tests.support.small_collection import RING, SMALL, planner, uniform
from training.collect import (
    CollectionPlan,
    Partner,
    Target,
    collect,
    games_with,
    read_manifest,
    read_shard,
)
from training.population import (
    load_partner_folder,
)


@pytest.fixture(scope="module")
def games():
    return games_with(RING, planner(), uniform("sp_1_100"), SMALL)


def test_both_seats_and_both_kinds_of_partner_are_played(games):
    assert games["seat"].tolist() == [0, 0, 1, 1]
    partner_actions = games["actions"][:, :, 1]
    deciding, sampling = partner_actions[[0, 2]], partner_actions[[1, 3]]
    assert len(np.unique(deciding)) == 1  # the likeliest of six equal actions is always the same
    assert len(np.unique(sampling)) == 6


def test_recorded_actions_lead_from_state_to_state(games):
    events = np.zeros((1, 2), np.int32)
    for game, seat in enumerate(games["seat"]):
        for t in range(59):
            kitchens = Kitchens(
                RING,
                *(games[name][game : game + 1, t].copy() for name in ("players", "contents")),
                np.zeros(1, np.int32),
            )
            joint = games["actions"][game : game + 1, t]
            kitchens.step(joint if seat == 0 else joint[:, ::-1], events)
            assert np.array_equal(kitchens.players[0], games["players"][game, t + 1])
            assert np.array_equal(kitchens.contents[0], games["contents"][game, t + 1])


def test_the_target_acts_by_the_distribution_that_is_written_down(games):
    own = games["actions"][..., 0].astype(int)
    assert (np.take_along_axis(games["law"], own[..., None], 2) > 0).all()
    free = games["stuck"][..., 0] < planner().mode.stuck_after
    assert (games["law"].max(-1)[free] == 1).all()


def test_the_second_episode_of_a_trajectory_begins_with_chefs_that_are_not_stuck():
    agent = load_agent("stay", RING)
    still = Partner("sp_1_100", "sp_1", "sp", agent.policy)
    stuck = games_with(RING, Target("stay", *agent), still, CollectionPlan(1, 410))["stuck"]
    assert (stuck[:, 399:402, 0] == [399, 0, 1]).all()
    assert (stuck[:, 400] == 0).all()


def test_the_same_seed_gives_the_same_games(games):
    again = games_with(RING, planner(), uniform("sp_1_100"), SMALL)
    other = games_with(RING, planner(), uniform("sp_1_100"), CollectionPlan(1, 60, seed=1))
    assert all(np.array_equal(games[name], again[name]) for name in games)
    assert not np.array_equal(games["actions"], other["actions"])


def test_an_interrupted_collection_continues_with_the_next_partner(tmp_path, monkeypatch):
    partners = [uniform(f"sp_{k}_100") for k in range(4)]
    reported = []

    def interrupt(share):
        reported.append(share)
        if len(reported) == 2:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        collect(tmp_path, RING, planner(), partners, SMALL, interrupt)
    before = {path.name: path.stat().st_mtime_ns for path in tmp_path.glob("*.safetensors")}
    assert len(before) == 2
    collect(tmp_path, RING, planner(), partners, SMALL)
    after = {path.name: path.stat().st_mtime_ns for path in tmp_path.glob("*.safetensors")}
    assert len(after) == 4
    assert {name: after[name] for name in before} == before
    assert set(read_manifest(tmp_path)["shards"]) == {partner.name for partner in partners}


def test_games_with_another_agent_of_the_same_name_are_not_mixed_in(tmp_path):
    folders = [tmp_path / "partners" / name for name in ("anna", "berta", "cleo")]
    config = NetworkConfig(hidden=(4,))
    for seed, folder in enumerate(folders):
        torch.manual_seed(seed)
        save_agent(folder, build_network(config, RING), config, RING, Mode(), "A card.", agent=folder.name)
    collected, before = tmp_path / "games", {}
    for _ in range(2):
        partners = load_partner_folder(tmp_path / "partners", RING)
        collect(collected, RING, planner(), partners, SMALL)
        after = {name: facts["sha256"] for name, facts in read_manifest(collected)["shards"].items()}
        changed = {name for name, digest in after.items() if before.get(name) != digest}
        assert changed == ({"anna"} if before else set(after))
        before = after
        save_agent(folders[0], build_network(config, RING), config, RING, Mode(), "A card.", agent="anna")


def test_two_partners_of_one_name_are_refused(tmp_path):
    with pytest.raises(ValueError, match="two partners are called 'sp_1'"):
        collect(tmp_path, RING, planner(), [uniform(name) for name in ("sp_1", "sp_2", "sp_3", "sp_1")], SMALL)


def test_what_an_interrupted_command_left_behind_is_not_a_partner(tmp_path):
    config = NetworkConfig(hidden=(4,))
    for name in ("anna", "berta", "cleo", ".anna.new-123"):
        save_agent(tmp_path / name, build_network(config, RING), config, RING, Mode(), "A card.", agent=name)
    assert [partner.name for partner in load_partner_folder(tmp_path, RING)] == ["anna", "berta", "cleo"]


def test_games_of_another_plan_are_not_mixed_in(tmp_path):
    partners = [uniform(f"sp_{k}") for k in range(3)]
    collect(tmp_path, RING, planner(), partners, SMALL)
    with pytest.raises(ValueError, match="another target or plan"):
        collect(tmp_path, RING, planner(), partners, CollectionPlan(1, 80))


def test_a_changed_shard_is_refused(tmp_path):
    collect(tmp_path, RING, planner(), [uniform(f"sp_{k}") for k in range(3)], SMALL)
    manifest = json.loads((tmp_path / "manifest.json").read_text())
    file = tmp_path / "sp_0.safetensors"
    file.write_bytes(file.read_bytes()[:-1] + b"x")
    with pytest.raises(ValueError, match="was changed"):
        read_shard(tmp_path, "sp_0", manifest["shards"]["sp_0"]["sha256"])
