import csv
import filecmp
import hashlib
import json
import os
import shutil
from collections.abc import Callable
from pathlib import Path

import polars as pl
import pytest

import kitchenmind
from server.export.import_checks import write_sums
from server.store import answers, arrivals, episodes, events, interventions, participants, studies, ticks
from server.store.database import Database
from server.store.withdrawal import withdraw
from tests.support.databases import with_tables
from tests.support.study_data import SPEC, fill, new_participant, played


def fill_all(database: Database) -> None:
    """Store all that a database can hold: two studies, odd texts, a withdrawal, episodes new, running and done."""
    study = database.write_now(fill)
    database.write_now(fill, people=1, key="matrix")
    database.write_now(studies.register, "ring", "a second version: ü\n")
    database.write_now(withdraw, database.write_now(new_participant, study))
    person = database.write_now(new_participant, study)
    said = {"a": "'=1", "b": "", "c": None, "d": -1.5, "e": 'a "quote",\nand a line', "f": ["x", 1], "g": "-3"}
    database.write_now(answers.save, answers.SubmittedPage(person, "odd, page", said))
    for timesteps in (None, 0, 5):
        new = episodes.NewEpisode(SPEC, f"episode-{timesteps}", (person, None), study, "tom")
        episode = database.write_now(episodes.create, new)
        if timesteps is not None:
            database.write_now(ticks.insert, played(episode, timesteps))
    database.write_now(episodes.create, episodes.NewEpisode(SPEC, "watch"))
    others = database.read_now(participants.of_study, study)
    for about in (None, database.read_now(episodes.of_participant, others[0].id)[0].id):
        database.write_now(interventions.exclude, others[0].id, about, ("idle", "saw it myself"), "anna")
    database.write_now(interventions.restore, 1, "anna")
    when = database.read_now(participants.of_study, study)[0].started_at
    database.write_now(events.add, events.Event("server_started", when))
    database.write_now(arrivals.count, study, "opened")
    database.write_now(arrivals.count, study, "unsuitable", "screen")


@pytest.fixture(scope="module")
def whole_export(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("whole")
    url = with_tables(folder / "study.db")
    with Database(url) as database:
        fill_all(database)
    assert kitchenmind.main(["export", "--database", url, "--out", str(folder / "export")]) == 0
    return folder / "export"


@pytest.fixture
def export(whole_export: Path, tmp_path: Path) -> Path:
    """Return an export to be changed. Its files do not depend on the kind of database."""
    return shutil.copytree(whole_export, tmp_path / "first")


@pytest.fixture
def export_of_database(url: str, database: Database, tmp_path: Path) -> Path:
    fill_all(database)
    assert kitchenmind.main(["export", "--database", url, "--out", str(tmp_path / "first")]) == 0
    return tmp_path / "first"


@pytest.mark.parametrize("kept", ["csv", "parquet"])
def test_imported_export_exports_to_the_same_files(export_of_database: Path, kept: str, tmp_path: Path) -> None:
    export = export_of_database
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
    assert len(paths) == 13 + 13 + 3
    same, different, missing = filecmp.cmpfiles(export, tmp_path / "second", map(str, paths), shallow=False)
    assert (different, missing) == ([], [])
    assert len(same) == len(paths)


def test_imported_ticks_are_the_ticks_that_were_exported(export_of_database: Path, url: str, tmp_path: Path) -> None:
    again = f"sqlite:///{tmp_path}/again.db"
    assert kitchenmind.main(["import", str(export_of_database), "--database", again]) == 0
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
        pl.read_parquet(path).drop("made_at").write_parquet(path)
    write_sums(export)
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


def test_folder_that_is_not_an_export_is_refused(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert kitchenmind.main(["import", str(tmp_path), "--database", f"sqlite:///{tmp_path}/new.db"]) == 2
    assert "codebook.json" in capsys.readouterr().err


def test_damaged_export_leaves_the_database_empty(
    export: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (export / "parquet" / "answers.parquet").write_bytes(b"PAR1 not a table PAR1")
    again = f"sqlite:///{tmp_path}/again.db"
    assert kitchenmind.main(["import", str(export), "--database", again]) == 2
    assert capsys.readouterr().err.startswith("kitchenmind import: ")
    with Database(again) as database:
        assert database.read_now(studies.every) == []


def refused(folder: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> str:
    """Return the message about an export that must be refused; nothing of it may be stored."""
    again = f"sqlite:///{tmp_path}/refused.db"
    assert kitchenmind.main(["import", str(folder), "--database", again]) == 2
    with Database(again) as database:
        assert database.read_now(studies.every) == []
    said = capsys.readouterr().err
    assert said.startswith("kitchenmind import: ")
    assert "Traceback" not in said
    return said


def forged(export: Path, table: str, column: str, value: object, where: Callable[[dict], bool] = bool) -> None:
    """Write another value into a table, as somebody would who also removed every hash."""
    for name in ("SHA256SUMS", "croissant.json"):
        (export / name).unlink(missing_ok=True)
    path = export / "parquet" / f"{table}.parquet"
    rows = pl.read_parquet(path).to_dicts()
    first = next(row for row in rows if where(row))
    first[column] = value
    pl.DataFrame(rows, infer_schema_length=None).write_parquet(path)


@pytest.mark.parametrize(
    ("table", "column", "value"),
    [
        ("studies", "study", "../../../outside/x"),
        ("studies", "study", "/outside"),
        ("studies", "study", "a/b"),
        ("studies", "study", "..\\x"),
        ("studies", "study", "x\n"),
        ("studies", "study", ""),
        ("studies", "study", None),
        ("episodes", "episode", "../../OUT"),
        ("episodes", "episode", "."),
        ("participants", "participant", "../" * 9 + "person"),
    ],
)
def test_name_that_would_lead_out_of_a_folder_is_refused(
    table: str, column: str, value: object, export: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    forged(export, table, column, value)
    if table == "studies" and value:  # the file is where the name leads
        for folder in (export / "studies", tmp_path / "outside", tmp_path / "a"):
            folder.mkdir(exist_ok=True)
        source = next((export / "studies").glob("*.yaml"))
        shutil.copy(source, tmp_path / "outside" / "x_version-1.yaml")
    assert f"{value!r} cannot be used as a file name" in refused(export, tmp_path, capsys)


def test_version_that_is_a_path_is_refused(export: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = export / "parquet" / "studies.parquet"
    rows = pl.read_parquet(path).to_dicts()
    for row in rows:
        row["study_version"] = "1/../../x"
    pl.DataFrame(rows, infer_schema_length=None).write_parquet(path)
    for name in ("SHA256SUMS", "croissant.json"):
        (export / name).unlink(missing_ok=True)
    assert "1/../../x" in refused(export, tmp_path, capsys)


def test_stored_name_that_would_lead_out_is_not_exported(database: Database, url: str, tmp_path: Path) -> None:
    """A database that was filled before imports were checked does no harm either."""
    database.write_now(studies.register, "../../outside", "name: x\n")
    assert kitchenmind.main(["export", "--database", url, "--out", str(tmp_path / "deep" / "out")]) == 2
    assert not list(tmp_path.rglob("*outside*"))


@pytest.mark.parametrize("link", ["studies/ring_version-1.yaml", "parquet/answers.parquet", "codebook.json", "studies"])
def test_link_in_an_export_is_refused(
    link: str, export: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    peers = tmp_path / "elsewhere"
    shutil.move(export / link, peers)
    (export / link).symlink_to(peers)
    assert f"{export / link} is a link" in refused(export, tmp_path, capsys)


def test_device_in_an_export_is_refused(export: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    os.mkfifo(export / "studies" / "pipe")
    assert "is a link or a device" in refused(export, tmp_path, capsys)


def test_every_file_of_an_export_is_in_its_sums(export: Path) -> None:
    lines = (export / "SHA256SUMS").read_text(encoding="utf-8").splitlines()
    listed = {name: digest for digest, name in (line.split("  ") for line in lines)}
    files = [path for path in export.rglob("*") if path.is_file() and path.name != "SHA256SUMS"]
    assert listed == {
        path.relative_to(export).as_posix(): hashlib.sha256(path.read_bytes()).hexdigest() for path in files
    }


@pytest.mark.parametrize("sums", ["SHA256SUMS", "croissant.json"])
def test_table_that_was_changed_is_refused(
    sums: str, export: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    if sums == "croissant.json":  # as exports were before: its hashes are those of the CSV files
        (export / "SHA256SUMS").unlink()
        shutil.rmtree(export / "parquet")
        path = export / "data" / "description-answers_data.csv"
        path.write_text(path.read_text(encoding="utf-8").replace("-1.5", "-1.6"), encoding="utf-8")
    else:
        path = export / "parquet" / "answers.parquet"
        pl.read_parquet(path).slice(1).write_parquet(path)
    assert f"{path} was changed after the export" in refused(export, tmp_path, capsys)


def test_table_that_came_later_is_refused(export: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    sums = export / "SHA256SUMS"
    lines = [line for line in sums.read_text().splitlines(keepends=True) if "parquet/ticks" not in line]
    sums.write_text("".join(lines))
    assert "ticks.parquet is not listed in SHA256SUMS" in refused(export, tmp_path, capsys)


def test_study_file_that_is_not_the_one_of_its_hash_is_refused(
    export: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    for name in ("SHA256SUMS", "croissant.json"):
        (export / name).unlink()
    (export / "studies" / "ring_version-1.yaml").write_text("name: other\n")
    assert "ring_version-1.yaml differs from the SHA-256" in refused(export, tmp_path, capsys)


def test_study_file_with_windows_line_ends_comes_back_as_it_was(database: Database, url: str, tmp_path: Path) -> None:
    database.write_now(studies.register, "windows", "name: windows\r\ntitle: x\r\n")
    assert kitchenmind.main(["export", "--database", url, "--out", str(tmp_path / "out")]) == 0
    again = f"sqlite:///{tmp_path}/again.db"
    assert kitchenmind.main(["import", str(tmp_path / "out"), "--database", again]) == 0
    with Database(again, read_only=True) as second:
        assert second.read_now(studies.every)[0].source == "name: windows\r\ntitle: x\r\n"


def _spec(**changes: object) -> str:
    import msgspec

    return json.dumps(msgspec.to_builtins(SPEC) | changes)


@pytest.mark.parametrize(
    ("spec", "reason"),
    [
        ("[" * 100_000, "its spec cannot be used"),
        ("{}", "its spec cannot be used"),
        (_spec(grid="XX"), "its spec cannot be used"),
        (_spec(horizon="long"), "its spec cannot be used"),
        (_spec(grid=SPEC.grid.replace("XXXPX", "XXPXX")), "its grid differs from layout_sha256"),
    ],
    ids=["deep", "empty", "no kitchen", "no number", "another kitchen"],
)
def test_episode_that_cannot_be_played_again_is_refused(
    spec: str, reason: str, export: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    forged(export, "episodes", "spec", spec)
    assert reason in refused(export, tmp_path, capsys)


def test_rows_that_do_not_belong_together_are_refused(
    export: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    forged(export, "answers", "participant", "nobody")
    assert "is damaged" in refused(export, tmp_path, capsys)
