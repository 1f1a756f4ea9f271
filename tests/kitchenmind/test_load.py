"""`kitchenmind.load` reads what `kitchenmind export` writes: a folder or a zip file, Parquet or CSV."""

import json
import shutil
import zipfile
from pathlib import Path

import polars as pl
import pytest

import kitchenmind
from kitchenmind.loaded_export import NotAnExport
from server.export import codebook
from server.export.files import table_path
from server.store.database import Database
from server.store.migrate import migrate
from tests.support.study_data import fill


@pytest.fixture(scope="module")
def exported(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("store")
    url = f"sqlite:///{folder}/study.db"
    migrate(url)
    with Database(url) as database:
        database.write_now(fill, 3)
    assert kitchenmind.main(["export", "--database", url, "--out", str(folder / "data")]) == 0
    return folder / "data"


@pytest.fixture(scope="module")
def only_csv(exported: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("csv") / "data"
    shutil.copytree(exported, folder, ignore=shutil.ignore_patterns("parquet"))
    return folder


def test_every_table_is_there_with_its_columns_and_rows(exported: Path) -> None:
    export = kitchenmind.load(exported)
    assert set(export) == {table.name for table in codebook.TABLES}
    assert export.episodes.height == 6
    assert export["ticks"].equals(pl.read_parquet(exported / "parquet" / "ticks.parquet"))
    assert export.ticks is export.ticks, "a table is read once"
    assert "episodes" in dir(export)
    assert "episodes" in repr(export)


def test_csv_has_the_types_and_texts_of_parquet(exported: Path, only_csv: Path) -> None:
    exact, read = kitchenmind.load(exported), kitchenmind.load(only_csv)
    for name in exact:
        wanted, found = exact[name], read[name]
        assert found.columns == wanted.columns
        for column, kind in wanted.schema.items():
            same = pl.Int64 if kind.is_integer() else pl.Float64 if kind.is_float() else kind
            assert found.schema[column] == same, (name, column)
            expected = wanted[column].fill_null("") if kind == pl.String else wanted[column].cast(same)
            given = found[column].fill_null("") if kind == pl.String else found[column]
            assert (
                given.to_list() == pytest.approx(expected.to_list(), nan_ok=True)
                if kind.is_float()
                else (given.to_list() == expected.to_list())
            ), (name, column)


def test_zip_file_of_the_dashboard_is_read(exported: Path, tmp_path: Path) -> None:
    """It has one folder with the study's name, like `server.commands.export_archive` makes it."""
    (tmp_path / "pack").mkdir()
    (tmp_path / "pack" / "ring").symlink_to(exported)
    archive = shutil.make_archive(str(tmp_path / "archive"), "zip", tmp_path / "pack", "ring")
    assert kitchenmind.load(archive).answers.equals(kitchenmind.load(exported).answers)


@pytest.mark.parametrize("file_format", ["parquet", "csv"])
def test_people_and_bots_in_one_export_are_warned_of(exported: Path, tmp_path: Path, file_format: str) -> None:
    folder = shutil.copytree(exported, tmp_path / "data")
    file = folder / table_path(Path(), file_format, "participants")
    table = pl.read_parquet(file) if file_format == "parquet" else pl.read_csv(file, infer_schema=False)
    simulated = pl.Series("simulated", [True, False, False])
    if file_format == "parquet":
        table.with_columns(simulated).write_parquet(file)
    else:
        table.with_columns(simulated.cast(pl.String)).write_csv(file)
        shutil.rmtree(folder / "parquet")
    with pytest.warns(UserWarning, match=r"has 2 people and 1 simulated participants\. Never pool them"):
        kitchenmind.load(folder)


def test_codebook_explains_every_table_and_column(exported: Path) -> None:
    export = kitchenmind.load(exported)
    assert export.codebook().columns == ["table", "row"]
    assert export.codebook()["table"].to_list() == list(export)
    book = export.codebook("episodes")
    assert book.columns == ["column", "type", "unit", "meaning"]
    assert book["column"].to_list() == export.episodes.columns
    assert book["meaning"].str.len_chars().min() > 0  # type: ignore[operator]


def test_unknown_table_is_named_with_those_there_are(exported: Path) -> None:
    export = kitchenmind.load(exported)
    with pytest.raises(KeyError, match=r"no table 'episode'. It has: studies, arrivals"):
        export["episode"]
    with pytest.raises(KeyError, match="no table 'episode'"):
        export.codebook("episode")
    with pytest.raises(AttributeError, match="no table 'episode'"):
        getattr(export, "episode")  # noqa: B009


def test_something_that_is_not_an_export_is_refused_with_the_remedy(exported: Path, tmp_path: Path) -> None:
    with pytest.raises(FileNotFoundError, match="nowhere does not exist"):
        kitchenmind.load(tmp_path / "nowhere")
    (tmp_path / "empty").mkdir()
    with pytest.raises(NotAnExport, match=r"has no codebook.json. Give the folder that `kitchenmind export"):
        kitchenmind.load(tmp_path / "empty")
    (tmp_path / "table.csv").write_text("a,b\n")
    with pytest.raises(NotAnExport, match="is not a zip file"):
        kitchenmind.load(tmp_path / "table.csv")
    with zipfile.ZipFile(tmp_path / "other.zip", "w") as other:
        other.writestr("readme.txt", "something else")
    with pytest.raises(NotAnExport, match=r"has no codebook.json"):
        kitchenmind.load(tmp_path / "other.zip")
    for name in ("one", "two"):
        (tmp_path / "both" / name).mkdir(parents=True)
        shutil.copy(exported / "codebook.json", tmp_path / "both" / name)
    with pytest.raises(NotAnExport, match=r"has several exports. Give the path of one of them: one, two"):
        kitchenmind.load(tmp_path / "both")


@pytest.mark.parametrize("text", ["{", "[]", json.dumps({"tables": {"episodes": []}}), "\x00"])
def test_broken_codebook_is_refused(tmp_path: Path, text: str) -> None:
    (tmp_path / "codebook.json").write_text(text)
    with pytest.raises(NotAnExport, match=r"codebook.json cannot be read"):
        kitchenmind.load(tmp_path)


def test_missing_and_damaged_tables_are_named(exported: Path, tmp_path: Path) -> None:
    shutil.copy(exported / "codebook.json", tmp_path)
    export = kitchenmind.load(tmp_path)
    with pytest.raises(NotAnExport, match="no file with the table 'answers'"):
        export["answers"]
    (tmp_path / "parquet").mkdir()
    (tmp_path / "parquet" / "answers.parquet").write_bytes(b"PAR1 but not really")
    with pytest.raises(NotAnExport, match=r"parquet/answers.parquet cannot be read"):
        export["answers"]
