"""Checkpoints of one's own are found by name, and no name leads out of their folder."""

import shutil
from pathlib import Path

import pytest

from models.agents.own_checkpoints import KEPT, OwnCheckpoints
from models.networks.checkpoint import CheckpointError, load_checkpoint
from server.required_models import WEIGHTS

SP, FCP = WEIGHTS / "coordination_ring" / "sp", WEIGHTS / "coordination_ring" / "fcp"
PREDICTOR = WEIGHTS / "coordination_ring" / "sp_predictor_stream"


@pytest.fixture
def own(tmp_path: Path) -> OwnCheckpoints:
    found = OwnCheckpoints(tmp_path / "models")
    shutil.copytree(SP, found.root / "nook" / "mine")
    shutil.copytree(PREDICTOR, found.root / "nook" / "mine_predictor_stream")
    shutil.copytree(FCP, found.root / "nook" / "partners" / "partner_2")
    return found


def test_complete_checkpoints_of_a_kitchen_are_listed_with_their_kind(own: OwnCheckpoints) -> None:
    (own.root / "nook" / "half").mkdir()
    (own.root / "nook" / "half" / "config.json").write_text("{}", encoding="utf-8")
    found = own.of_kitchen("nook")
    assert {name: one.kind for name, one in found.items()} == {"mine": "agent", "mine_predictor_stream": "predictor"}
    assert found["mine"].sha256 == load_checkpoint(SP).sha256
    assert own.of_kitchen("cave") == OwnCheckpoints(own.root / "none").of_kitchen("nook") == {}
    assert "it has no weights.safetensors" in str(own.fault("nook", "half"))


@pytest.mark.parametrize("name", ["../mine", "..", ".", "", "nook/mine", "/etc", "mine\0", KEPT, "m" * 81])
def test_only_a_name_names_a_checkpoint(own: OwnCheckpoints, name: str) -> None:
    assert own.find("nook", name) is None
    assert own.find(name, "mine") is None
    assert own.fault("nook", name) is None


def test_a_link_out_of_the_folder_is_not_followed(own: OwnCheckpoints, tmp_path: Path) -> None:
    (own.root / "nook" / "linked").symlink_to(SP)
    (own.root / "cave").symlink_to(SP.parent)
    shutil.copytree(SP, own.root / "nook" / "file")
    (own.root / "nook" / "file" / "weights.safetensors").unlink()
    (own.root / "nook" / "file" / "weights.safetensors").symlink_to(SP / "weights.safetensors")
    assert own.find("nook", "linked") is own.find("cave", "sp") is own.find("nook", "file") is None
    assert "leads out of" in str(own.fault("nook", "linked"))
    (tmp_path / "here").symlink_to(own.root)
    assert OwnCheckpoints(tmp_path / "here").find("nook", "mine") is not None, "the folder itself may be a link"


def test_a_kept_checkpoint_is_not_changed_by_the_next_training(own: OwnCheckpoints) -> None:
    before = load_checkpoint(SP).sha256
    own.keep("nook", "mine", before)
    own.keep("nook", "mine", before)
    shutil.rmtree(own.root / "nook" / "mine")
    shutil.copytree(FCP, own.root / "nook" / "mine")
    kept, now = own.find("nook", "mine", before), own.find("nook", "mine")
    assert kept is not None
    assert now is not None
    assert load_checkpoint(kept.folder).sha256 == before
    assert (kept.sha256, now.sha256) == (before, load_checkpoint(FCP).sha256)
    assert set(own.of_kitchen("nook")) == {"mine", "mine_predictor_stream"}
    with pytest.raises(CheckpointError, match="there is no checkpoint with the SHA-256 00"):
        own.keep("nook", "mine", "00")


def test_a_damaged_checkpoint_is_not_kept(own: OwnCheckpoints) -> None:
    weights = own.root / "nook" / "mine" / "weights.safetensors"
    weights.write_bytes(weights.read_bytes()[:-1] + b"\0\0")
    with pytest.raises(CheckpointError, match="its bytes are not those that were saved"):
        own.keep("nook", "mine", load_checkpoint(SP).sha256)
    assert list((own.root / KEPT).iterdir()) == []
