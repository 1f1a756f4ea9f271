"""Collected games: the pairs of agents, the stored arrays, and the predictor's inputs from them."""

import json
from pathlib import Path

import numpy as np
import pytest
import torch

from models.agents.catalogue import load_agent
from models.networks.config import NetworkConfig, PredictorConfig
from models.networks.policy import NetworkPolicy, build_network, save_agent
from models.networks.predictor import Encoder
from models.protocols import Mode
from overcooked.layout import load_layout
from overcooked.state import Kitchens
from training.collect import (
    CollectionPlan,
    Partner,
    Target,
    collect,
    games_with,
    read_manifest,
    read_shard,
    split_by_agent,
)
from training.dataset import NONE, episodes_of, load_episodes, stream_batch, window_batch
from training.population import (
    NoisyPolicy,
    load_extras,
    load_partner_folder,
    load_population,
    with_itself_and_extras,
)

RING = load_layout("coordination_ring")
SMALL = CollectionPlan(trajectories=1, timesteps=60)


def planner():
    agent = load_agent("planner", RING)
    return Target("planner", agent.policy, agent.mode, "0" * 64)


def uniform(name, agent=None, kind="sp"):
    return Partner(name, agent or name, kind, load_agent("random", RING).policy)


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


def test_partner_agents_are_split_three_to_one_to_one_with_all_their_skills():
    partners = [
        uniform(f"{kind}_{k}_{skill}", f"{kind}_{k}", kind)
        for kind in ("sp", "fcp")
        for k in range(5)
        for skill in (35, 100)
    ]
    split = split_by_agent([*partners, uniform("itself", kind="self"), uniform("noise", kind="extra")])
    for kind in ("sp", "fcp"):
        parts = [split[f"{kind}_{k}"] for k in range(5)]
        assert [parts.count(part) for part in ("train", "validation", "test")] == [3, 1, 1]
    assert split["itself"] == split["noise"] == "train"


def test_two_partner_agents_cannot_be_split():
    with pytest.raises(ValueError, match="Train at least 3"):
        split_by_agent([uniform("sp_1"), uniform("sp_2")])


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


def test_features_are_what_the_encoder_makes_of_the_observation(games):
    encoder = Encoder(RING, PredictorConfig())
    episodes = episodes_of(games, RING, encoder)
    for game, t in ((0, 0), (1, 30), (3, 59)):
        state = [games[name][game : game + 1, t].copy() for name in ("players", "contents")]
        seen = Kitchens(RING, *state, games["timestep"][game : game + 1, t].astype(np.int32)).encode()
        expected = encoder(torch.from_numpy(seen[:, games["seat"][game]]))[0]
        assert torch.allclose(episodes.features[game, t].float(), expected, atol=1e-3)


def test_labels_are_the_next_three_actions_and_nothing_beyond_the_end(games):
    episodes = episodes_of(games, RING, Encoder(RING, PredictorConfig()))
    own, labels = games["actions"][..., 0], episodes.labels()
    assert labels[2, 10].tolist() == own[2, 10:13].tolist()
    assert labels[2, 58].tolist() == [own[2, 58], own[2, 59], NONE]
    assert labels[2, 59].tolist() == [own[2, 59], NONE, NONE]


def test_a_stretch_shows_the_joint_action_before_each_state(games):
    episodes = episodes_of(games, RING, Encoder(RING, PredictorConfig()))
    _, actions, labels = stream_batch(episodes, episodes.labels(), np.array([1]), np.array([20]), 5)
    for k in range(5):
        first, second = games["actions"][1, 19 + k]
        assert actions[0, k].nonzero().flatten().tolist() == [first, 6 + second]
        assert labels[0, k, 0] == games["actions"][1, 20 + k, 0]
    start = stream_batch(episodes, episodes.labels(), np.array([1]), np.array([0]), 1)[1]
    assert not start.any()


def test_a_window_shows_ten_actions_with_the_current_one_hidden(games):
    episodes = episodes_of(games, RING, Encoder(RING, PredictorConfig()))
    features, actions, present, labels = window_batch(episodes, episodes.labels(), np.array([2, 2]), np.array([25, 3]))
    assert present.sum(1).tolist() == [10, 4]
    assert not actions[:, -1].any()
    for place, t in enumerate(range(16, 25)):
        first, second = games["actions"][2, t]
        assert actions[0, place].nonzero().flatten().tolist() == [first, 6 + second]
    assert not actions[1, :6].any()
    assert not features[1, :6].any()
    assert torch.equal(features[1, 6:], episodes.features[2, :4].float())
    assert labels[:, 0].tolist() == [games["actions"][2, 25, 0], games["actions"][2, 3, 0]]


def test_a_split_without_partners_is_reported(tmp_path):
    collect(tmp_path, RING, planner(), [uniform(f"sp_{k}") for k in range(3)], SMALL)
    encoder = Encoder(RING, PredictorConfig())
    assert len(load_episodes(tmp_path, "test", RING, encoder)) == 4
    with pytest.raises(ValueError, match="kept for nobody"):
        load_episodes(tmp_path, "nobody", RING, encoder)


def test_a_noisy_agent_does_anything_in_a_share_of_its_timesteps():
    observations = Kitchens.start(RING, 2).encode()[:, 0]
    decided = load_agent("planner", RING).policy
    action_distribution = NoisyPolicy(decided, 0.3).probabilities(observations)
    assert np.allclose(np.sort(action_distribution, axis=1), [[0.05] * 5 + [0.75]] * 2)
    assert (action_distribution.argmax(1) == decided.probabilities(observations).argmax(1)).all()


def test_a_population_on_disk_is_found_by_the_names_of_its_agents(tmp_path):
    config = NetworkConfig()
    for kind in ("sp", "fcp"):
        for seed in (1, 2, 3):
            folder = tmp_path / "population" / f"{kind}_{seed}_100"
            save_agent(
                folder,
                build_network(config, RING),
                config,
                RING,
                Mode(),
                "A card.",
                agent=f"population_{kind}_{seed}_100",
            )
    save_agent(tmp_path / "sp", build_network(config, RING), config, RING, Mode(), "A card.", agent="sp")
    population = load_population(tmp_path, RING)
    assert [partner.name for partner in population] == [
        f"{kind}_{seed}_100" for kind in ("fcp", "sp") for seed in (1, 2, 3)
    ]
    everybody = with_itself_and_extras(planner(), population, RING)
    assert [partner.kind for partner in everybody].count("self") == 1
    assert {partner.name for partner in everybody if partner.kind == "extra"} >= {"itself_noise_30", "scripted_planner"}
    assert not any("sp_3" in partner.name for partner in everybody if partner.kind == "extra")
    assert isinstance(population[0].policy, NetworkPolicy)


def test_a_population_is_found_from_inside_its_folder(tmp_path, monkeypatch):
    config = NetworkConfig(hidden=(4,))
    folder = tmp_path / "population"
    for name in ("sp_1_100", "sp_2_100"):
        save_agent(folder / name, build_network(config, RING), config, RING, Mode(), "A card.", agent=name)
    monkeypatch.chdir(folder)
    assert [partner.name for partner in load_population(Path(), RING)] == ["sp_1_100", "sp_2_100"]


def test_an_empty_population_names_the_remedy(tmp_path):
    with pytest.raises(ValueError, match="kitchenmind train study"):
        load_population(tmp_path, RING)


def test_more_agents_can_be_trained_on_and_are_never_tested_on(tmp_path):
    config = NetworkConfig(hidden=(16,))
    folder = tmp_path / "sp_4_20"
    save_agent(folder, build_network(config, RING), config, RING, Mode(), "A card.", agent="sp_4_20")
    (extra,) = load_extras({"sp_4_20": folder}, RING)
    population = [uniform(f"sp_{k}_100", f"sp_{k}") for k in range(5)]
    split = split_by_agent([*population, extra])
    assert (extra.name, split[extra.agent]) == ("extra_sp_4_20", "train")
    assert split["sp_4"] == "test"
    with pytest.raises(ValueError, match="there is no folder"):
        load_extras({"nobody": tmp_path / "nobody"}, RING)


def test_an_agent_whose_card_says_sampling_samples_as_a_partner(tmp_path):
    config = NetworkConfig(hidden=(16,))
    for name, mode in {"like_people": Mode(0.7, 3, 0.5), "decided": Mode(0.0, 8, 0.5)}.items():
        save_agent(tmp_path / name, build_network(config, RING), config, RING, mode, "A card.", agent=name)
    extras = load_extras({folder.name: folder for folder in sorted(tmp_path.iterdir())}, RING)
    assert [extra.mode for extra in extras] == [None, Mode(0.7, 3, 0.5)]


def test_what_a_partner_does_next_is_known_up_to_the_last_timestep():
    shard = games_with(RING, planner(), uniform("random"), SMALL)
    episodes = episodes_of(shard, RING, Encoder(RING, PredictorConfig()))
    labels = episodes.partner_labels()
    did = shard["actions"][0, :, 1]
    for step in range(3):
        known = len(did) - 1 - step
        assert labels[0, :known, step].tolist() == did[step : step + known].tolist()
        assert (labels[0, known:, step] == NONE).all()
