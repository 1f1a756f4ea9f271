"""`kitchenmind study models` deletes only copies that nothing stored names."""

import shutil
from pathlib import Path

import pytest

import kitchenmind
from models.agents.own_checkpoints import KEPT, OwnCheckpoints
from models.networks.checkpoint import load_checkpoint
from server.participation.own_kitchens import keep_own_models, with_own_models
from server.store import studies
from server.store.database import Database
from server.store.tables import episodes
from server.study.loader import parse_study
from tests.server.participation.test_own_models import MINE, RING
from tests.support.databases import with_tables
from tests.support.study_data import fill


def test_only_copies_that_nothing_stored_names_are_deleted(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    models = tmp_path / "models"
    for name, bundled in (("mine", "sp"), ("mine_predictor_stream", "sp_predictor_stream"), ("played", "fcp")):
        shutil.copytree(RING / bundled, models / "nook" / name)
    shutil.copytree(RING / "fcp_predictor_stream", models / "nook" / "tried")
    sums = {name: load_checkpoint(models / "nook" / name).sha256 for name in ("played", "tried")}
    file = with_own_models(parse_study(MINE), models)
    keep_own_models(file)
    for name, sha256 in sums.items():
        OwnCheckpoints(models).keep("nook", name, sha256)
    words = ["study", "models", "--data", str(tmp_path)]
    with Database(with_tables(tmp_path / "kitchenmind.sqlite3")) as database:
        assert kitchenmind.main([*words, "--delete-unused"]) == 2, "perhaps the wrong database"
        assert "this database has no studies" in capsys.readouterr().err
        database.write_now(fill, 1)
        database.write_now(
            lambda connection: connection.execute(episodes.update().values(agent_0_sha256=sums["played"]))
        )
        database.write_now(studies.register, "pilot", "not: [a study of this version\n" + file.text)
    assert kitchenmind.main(words) == 0
    said = capsys.readouterr().out
    assert said.count("pilot 1") == 2
    assert f"{sums['tried'][:12]}  predictor" in said
    assert said.splitlines()[-1].startswith("kept: 4 copies, ")
    assert "unused: 1 copy, " in said
    assert len(list((models / KEPT).iterdir())) == 4, "nothing is deleted unasked"
    assert kitchenmind.main([*words, "--delete-unused"]) == 0
    left = {*file.study.checkpoints.values(), sums["played"]}
    assert {path.name for path in (models / KEPT).iterdir()} == left
    assert (models / "nook" / "tried").is_dir(), "the folder that training wrote stays"
