"""An agent as it is served equals the network that was trained."""

import subprocess
import sys

import numpy as np
import pytest
import torch

from models.agents.catalogue import load_agent
from models.networks.checkpoint import CheckpointError, save_checkpoint
from models.networks.config import NetworkConfig
from models.networks.policy import NetworkPolicy, build_network, load_network, save_agent
from models.protocols import Mode
from overcooked.layout import load_layout
from overcooked.state import Kitchens

RING = load_layout("coordination_ring")
MATRIX = load_layout("matrix")  # wider than high


def states(layout, games=30):
    kitchens, draws = Kitchens.start(layout, games), np.random.default_rng(0)
    for _ in range(60):
        kitchens.step(draws.integers(0, 6, (games, 2)).astype(np.int8), np.zeros((games, 2), np.int32))
    return kitchens.encode()[:, 1].copy()


@pytest.mark.parametrize("layout", [RING, MATRIX], ids=lambda layout: layout.name)
@pytest.mark.parametrize("kind", ["mlp", "cnn"])
def test_a_served_agent_gives_the_probabilities_of_its_network(tmp_path, kind, layout):
    torch.manual_seed(0)
    config = NetworkConfig(kind, hidden=(64, 64, 64))
    network = build_network(config, layout)
    torch.nn.init.normal_(network.head.policy.weight)
    save_agent(tmp_path / "agent", network, config, layout, Mode(), "# Card", agent="sp")
    expected = NetworkPolicy(load_network(tmp_path / "agent")).probabilities(states(layout))
    served = load_agent(str(tmp_path / "agent"), layout).policy.probabilities(states(layout))
    assert served.dtype == np.float32
    assert np.abs(served - expected).max() < 1e-5
    assert expected.std(axis=0).max() > 0.01


def test_a_folder_with_other_weights_is_not_an_agent(tmp_path):
    config = {
        "format": "kitchenmind agent 1",
        "grid": RING.text,
        "layout": "x",
        "network": {"kind": "mlp", "hidden": [4]},
    }
    save_checkpoint(tmp_path / "a", config, {"x": np.zeros(1, np.float32)}, "A card.")
    with pytest.raises(CheckpointError, match="not a readable agent"):
        load_agent(str(tmp_path / "a"), RING)


def test_agents_and_predictors_of_every_form_are_served_without_torch(tmp_path):
    """It takes seconds to load and hundreds of megabytes to keep, and a server does not install it."""
    config = NetworkConfig("cnn", hidden=(8,))
    save_agent(tmp_path / "cnn", build_network(config, RING), config, RING, Mode(), "# Card", agent="sp")
    code = f"""
import sys
sys.modules["torch"] = None
from models.inference.worker import Worker
from models.inference.wire import Load
ring = "coordination_ring"
Worker(Load(((ring, "sp"), (ring, "fcp"), (ring, {str(tmp_path / "cnn")!r})), ((ring, "sp_predictor_stream"),)))
"""
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0
