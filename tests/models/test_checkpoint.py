"""Checkpoints on disk: what comes back, and what is refused."""

import errno
from pathlib import Path
from typing import NoReturn

import numpy as np
import pytest
import torch

from models.networks.checkpoint import FILES, CheckpointError, load_checkpoint, save_checkpoint
from models.networks.config import NetworkConfig
from models.networks.policy import NetworkPolicy, build_network, load_network, save_agent
from models.networks.stored_tensors import Bits
from models.protocols import Mode
from overcooked.layout import load_layout
from overcooked.state import Kitchens


def _saved(folder: Path) -> str:
    return save_checkpoint(folder, {"a": 1}, {"w": torch.arange(6.0).view(2, 3)}, "# A card")


def test_a_checkpoint_comes_back_as_it_was_saved(tmp_path: Path) -> None:
    digest = _saved(tmp_path / "one")
    loaded = load_checkpoint(tmp_path / "one")
    assert loaded.config == {"a": 1}
    assert loaded.tensors["w"].tolist() == [[0, 1, 2], [3, 4, 5]]
    assert loaded.card == "# A card\n"
    assert loaded.sha256 == digest


@pytest.mark.parametrize("name", [*FILES, "sha256"])
def test_a_changed_byte_is_refused_and_the_file_named(tmp_path: Path, name: str) -> None:
    _saved(tmp_path / "one")
    path = tmp_path / "one" / name
    content = bytearray(path.read_bytes())
    content[len(content) // 2] ^= 1
    path.write_bytes(bytes(content))
    with pytest.raises(CheckpointError, match=r"one/.*(sha256|card|weights|config)"):
        load_checkpoint(tmp_path / "one")


@pytest.mark.parametrize("name", [*FILES, "sha256"])
def test_a_missing_file_is_refused_and_named(tmp_path: Path, name: str) -> None:
    _saved(tmp_path / "one")
    (tmp_path / "one" / name).unlink()
    with pytest.raises(CheckpointError, match=f"{name}: missing"):
        load_checkpoint(tmp_path / "one")


def test_a_folder_that_does_not_exist_is_refused(tmp_path: Path) -> None:
    with pytest.raises(CheckpointError, match="no such checkpoint folder"):
        load_checkpoint(tmp_path / "nowhere")


def test_saving_again_replaces_the_whole_folder(tmp_path: Path) -> None:
    _saved(tmp_path / "one")
    (tmp_path / "one" / ".DS_Store").touch()
    _saved(tmp_path / "one")
    assert sorted(path.name for path in (tmp_path / "one").iterdir()) == sorted([*FILES, "sha256"])
    assert [path.name for path in tmp_path.iterdir()] == ["one"]


class OnGpu(torch.Tensor):
    """A tensor that numpy cannot read, as one in the memory of a GPU, until it is copied to the CPU."""

    def __array__(self, *_: object, **__: object) -> NoReturn:
        raise TypeError("can't convert cuda:0 device type tensor to numpy. Use Tensor.cpu() first.")

    def cpu(self) -> torch.Tensor:
        return self.as_subclass(torch.Tensor)


@pytest.mark.parametrize("bits", [32, 16, 8])
def test_weights_that_are_on_a_gpu_are_saved(tmp_path: Path, bits: Bits) -> None:
    weights = torch.linspace(-1, 1, 8192).view(64, 128)
    save_checkpoint(tmp_path / "a", {}, {"weight": weights.as_subclass(OnGpu)}, "# a", bits)
    assert np.abs(load_checkpoint(tmp_path / "a").tensors["weight"] - weights.numpy()).max() < 0.01


@pytest.mark.parametrize("kind", ["mlp", "cnn"])
def test_an_agent_saved_in_16_bits_plays_as_before(tmp_path: Path, kind: str) -> None:
    layout = load_layout("coordination_ring")
    torch.manual_seed(0)
    config = NetworkConfig(kind, hidden=(64, 64, 64))
    network = build_network(config, layout)
    torch.nn.init.normal_(network.head.policy.weight)
    save_agent(tmp_path / "agent", network, config, layout, Mode(), "# Card", agent="sp")
    seen = Kitchens.start(layout, 2).encode()[:, 0].copy()
    before = NetworkPolicy(network).probabilities(seen)
    after = NetworkPolicy(load_network(tmp_path / "agent")).probabilities(seen)
    assert before.shape == (2, 6)
    assert before.dtype == np.float32
    np.testing.assert_allclose(before, after, atol=5e-3)


def test_a_checkpoint_of_something_else_is_not_an_agent(tmp_path: Path) -> None:
    _saved(tmp_path / "one")
    with pytest.raises(CheckpointError, match="not a readable agent"):
        load_network(tmp_path / "one")


def test_a_folder_with_something_else_is_never_replaced(tmp_path: Path) -> None:
    (tmp_path / "partners" / "anna").mkdir(parents=True)
    with pytest.raises(CheckpointError, match=r"partners: holds anna, which .* would delete. Give a folder of its own"):
        _saved(tmp_path / "partners")
    assert [path.name for path in tmp_path.iterdir()] == ["partners"]
    assert [path.name for path in (tmp_path / "partners").iterdir()] == ["anna"]


def test_a_full_disk_leaves_the_old_checkpoint_and_nothing_else(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    before = _saved(tmp_path / "a")

    def full(*_: object, **__: object) -> NoReturn:
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr(Path, "write_text", full)
    with pytest.raises(OSError, match="No space"):
        _saved(tmp_path / "a")
    assert [path.name for path in tmp_path.iterdir()] == ["a"]
    assert load_checkpoint(tmp_path / "a").sha256 == before
