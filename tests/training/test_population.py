"""The partners of a target while its games are collected: found on disk, split, and how they act."""

from pathlib import Path

import numpy as np
import pytest

from models.agents.catalogue import load_agent
from models.networks.config import NetworkConfig
from models.networks.policy import NetworkPolicy, build_network, save_agent
from models.protocols import Mode
from overcooked.state import Kitchens
from tests.support.small_collection import RING, planner, uniform
from training.collect import (
    split_by_agent,
)
from training.population import (
    NoisyPolicy,
    load_extras,
    load_population,
    with_itself_and_extras,
)


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
