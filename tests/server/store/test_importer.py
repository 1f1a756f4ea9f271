import csv
import filecmp
import shutil
from collections.abc import Iterator
from pathlib import Path

import pytest
from pyarrow import parquet
from study_data import SPEC, fill, new_participant, played

import kitchenmind
from server.store import answers, arrivals, decisions, episodes, events, participants, studies, ticks
from server.store.database import Database
from server.store.withdrawal import withdraw


@pytest.fixture
def export(url: str, tmp_path: Path) -> Iterator[Path]:
    """Everything that a database can hold: two studies, odd texts, a withdrawal, episodes new, running and done."""
    with Database(url) as database:
        study = database.write_now(fill)
        database.write_now(fill, people=1, key="matrix")
        database.write_now(studies.register, "ring", "a second version: ü\n")
        database.write_now(withdraw, database.write_now(new_participant, study))
        person = database.write_now(new_participant, study)
        said = {"a": "'=1", "b": "", "c": None, "d": -1.5, "e": 'a "quote",\nand a line', "f": ["x", 1], "g": "-3"}
        database.write_now(answers.save, answers.Page(person, "odd, page", said))
        for timesteps in (None, 0, 5):
            new = episodes.NewEpisode(SPEC, f"episode-{timesteps}", (person, None), study, "tom")
            episode = database.write_now(episodes.create, new)
            if timesteps is not None:
                database.write_now(ticks.insert, played(episode, timesteps))
        database.write_now(episodes.create, episodes.NewEpisode(SPEC, "watch"))
        others = database.read_now(participants.of_study, study)
        for about in (None, database.read_now(episodes.of_participant, others[0].id)[0].id):
            database.write_now(decisions.exclude, others[0].id, about, ("idle", "saw it myself"), "anna")
        database.write_now(decisions.restore, 1, "anna")
        when = database.read_now(participants.of_study, study)[0].started_at
        database.write_now(events.add, events.Event("server_started", when))
        database.write_now(arrivals.count, study, "opened")
        database.write_now(arrivals.count, study, "unsuitable", "screen")
        assert kitchenmind.main(["export", "--database", url, "--out", str(tmp_path / "first")]) == 0
        yield tmp_path / "first"


@pytest.mark.parametrize("kept", ["csv", "parquet"])
def test_imported_export_exports_to_the_same_files(export: Path, kept: str, tmp_path: Path) -> None:
    again = f"sqlite:///{tmp_path}/again.db"
    folder = tmp_path / "one format"
    shutil.copytree(export, folder)
    shutil.rmtree(folder / ("parquet" if kept == "csv" else "data"))
    assert kitchenmind.main(["import", str(folder), "--database", again]) == 0
    assert kitchenmind.main(["verify", "--database", again]) == 0
    assert kitchenmind.main(["export", "--database", again, "--out", str(tmp_path / "second")]) == 0
    paths = [
        path.relative_to(export) for path in export.rglob("*") if path.parent.name in ("data", "parquet", "studies")
    ]
    assert len(paths) == 12 + 12 + 3
    same, different, missing = filecmp.cmpfiles(export, tmp_path / "second", map(str, paths), shallow=False)
    assert (different, missing) == ([], [])
    assert len(same) == len(paths)


def test_imported_ticks_are_the_ticks_that_were_exported(export: Path, url: str, tmp_path: Path) -> None:
    again = f"sqlite:///{tmp_path}/again.db"
    assert kitchenmind.main(["import", str(export), "--database", again]) == 0
    with Database(url, read_only=True) as first, Database(again, read_only=True) as second:
        for study in first.read_now(studies.every):
            for person in first.read_now(participants.of_study, study.id):
                for episode in first.read_now(episodes.of_participant, person.id):
                    assert second.read_now(ticks.of_episode, episode.id) == first.read_now(ticks.of_episode, episode.id)
                    assert second.read_now(episodes.load, episode.id) == first.read_now(episodes.load, episode.id)


@pytest.mark.parametrize("kept", ["csv", "parquet"])
def test_export_of_an_earlier_version_without_inputs_is_imported(export: Path, kept: str, tmp_path: Path) -> None:
    shutil.rmtree(export / ("parquet" if kept == "csv" else "data"))
    if kept == "csv":
        (export / "data" / "description-inputs_data.csv").unlink()
        path = export / "data" / "description-ticks_data.csv"
        rows = list(csv.DictReader(path.read_text(encoding="utf-8").splitlines()))
        with path.open("w", newline="", encoding="utf-8") as file:
            writer = csv.DictWriter(file, [name for name in rows[0] if name != "made_at"], extrasaction="ignore")
            writer.writeheader()
            writer.writerows(rows)
    else:
        (export / "parquet" / "inputs.parquet").unlink()
        path = export / "parquet" / "ticks.parquet"
        parquet.write_table(parquet.read_table(path).drop_columns(["made_at"]), path)
    again = f"sqlite:///{tmp_path}/again.db"
    assert kitchenmind.main(["import", str(export), "--database", again]) == 0
    assert kitchenmind.main(["verify", "--database", again]) == 0


def test_import_into_a_database_that_has_something_is_refused(
    export: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    again = f"sqlite:///{tmp_path}/again.db"
    assert kitchenmind.main(["import", str(export), "--database", again]) == 0
    assert kitchenmind.main(["import", str(export), "--database", again]) == 2
    assert "is not empty" in capsys.readouterr().err


def test_folder_that_is_no_export_is_refused(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert kitchenmind.main(["import", str(tmp_path), "--database", f"sqlite:///{tmp_path}/new.db"]) == 2
    assert "codebook.json" in capsys.readouterr().err


def test_damaged_export_leaves_the_database_empty(
    export: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (export / "parquet" / "answers.parquet").write_bytes(b"PAR1 this is no table PAR1")
    again = f"sqlite:///{tmp_path}/again.db"
    assert kitchenmind.main(["import", str(export), "--database", again]) == 2
    assert capsys.readouterr().err.startswith("kitchenmind import: ")
    with Database(again) as database:
        assert database.read_now(studies.every) == []
