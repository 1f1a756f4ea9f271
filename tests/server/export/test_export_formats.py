"""What `kitchenmind export` refuses, and formats for other tools: Croissant, trajectories."""

import subprocess
import sys
import warnings
from pathlib import Path

import polars as pl
import pytest

import kitchenmind
from overcooked.trajectory import read_trajectories
from server.export import files as export_files
from server.store.database import Database
from tests.support.exported import TABLES, Exported, of_any_kind, parquet

ROOT = Path(__file__).resolve().parents[3]


@of_any_kind
def test_folder_that_is_not_empty_is_refused_and_left_alone(
    filled: Database, url: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "out").mkdir()
    (tmp_path / "out" / "thesis.txt").write_text("do not touch")
    assert kitchenmind.main(["export", "--database", url, "--out", str(tmp_path / "out")]) == 2
    assert "is not empty" in capsys.readouterr().err
    assert [path.name for path in (tmp_path / "out").iterdir()] == ["thesis.txt"]


@of_any_kind
def test_unknown_format_is_refused(
    filled: Database, url: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert kitchenmind.main(["export", "--database", url, "--out", str(tmp_path / "out"), "--format", "csv,xlsx"]) == 2
    assert "no format xlsx" in capsys.readouterr().err
    assert not (tmp_path / "out").exists()


@of_any_kind
def test_failed_export_leaves_nothing_behind(
    filled: Database, url: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def no_space(*_: object) -> None:
        raise OSError(28, "No space left on device")

    folder = tmp_path / "results"
    folder.mkdir()
    monkeypatch.setattr(export_files.TableWriter, "write", no_space)
    assert kitchenmind.main(["export", "--database", url, "--out", str(folder / "out")]) == 2
    assert list(folder.iterdir()) == []


@of_any_kind
def test_croissant_file_is_accepted_and_leads_to_the_rows(filled: Database, exported: Exported) -> None:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # of the libraries that mlcroissant is made of
        import mlcroissant

        for formats in ("csv", "parquet"):
            folder = exported("--format", formats, name=formats)
            dataset = mlcroissant.Dataset(jsonld=folder / "croissant.json")
            assert dataset.metadata.ctx.issues.errors == set()
            assert {records.name for records in dataset.metadata.record_sets} == set(TABLES)
            first = next(iter(dataset.records("answers")))
            assert first["answers/question"] == b"partner"


@of_any_kind
def test_trajectories_are_readable_in_the_format_of_overcooked_ai(filled: Database, exported: Exported) -> None:
    folder = exported("--format", "parquet,overcooked_ai")
    files = sorted((folder / "trajectories").iterdir())
    frame = parquet(folder, "ticks")
    assert [path.stem for path in files] == sorted(set(frame["episode"]))
    for path in files:
        rows = frame.filter(pl.col("episode") == path.stem)
        [(layout, joint_actions)] = read_trajectories(path)
        assert layout.name == "coordination_ring"
        assert joint_actions == [list(pair) for pair in rows.select("action_0", "action_1").iter_rows()]


@of_any_kind
def test_trajectories_alone_are_refused(
    filled: Database, url: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    words = ["export", "--database", url, "--out", str(tmp_path / "out"), "--format", "overcooked_ai"]
    assert kitchenmind.main(words) == 2
    assert "add csv or parquet" in capsys.readouterr().err


def test_export_needs_neither_torch_nor_a_web_server() -> None:
    code = "import server.export.writer, sys; assert not {'torch', 'fastapi'} & set(sys.modules)"
    subprocess.run([sys.executable, "-c", code], check=True, cwd=ROOT)
