"""A damaged or edited export: the error names file, row and remedy, or the report says what was changed."""

import hashlib
from pathlib import Path

import polars as pl
import pytest

import kitchenmind
from analysis.factorial_within import repeated_factors
from analysis.report import write_report
from analysis.study import Options, analyse
from analysis.synthetic import Truth, write_export
from analysis.table_files import INTENTIONS, ExportError
from analysis.tables import read_export

QUICK = Options(power_studies=20, draws=50)
ROW = pl.int_range(pl.len()) == 1  # row 3 of the CSV file


@pytest.fixture(scope="module")
def exported(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("exported")
    write_export(Truth(participants=4, layouts=("matrix",), timesteps=5, broken=0), folder)
    return folder


def edited(exported: Path, out: Path, name: str, *changes: pl.Expr, twice: bool = False) -> Path:
    """Copy the export as CSV; one table is changed as text."""
    out.mkdir()
    for path in exported.glob("*.parquet"):
        table = pl.read_parquet(path)
        if path.stem == name:
            table = table.with_columns(pl.all().cast(pl.String)).with_columns(changes)
            table = pl.concat([table, table[1:2]]) if twice else table
        table.write_csv(out / f"description-{path.stem}_data.csv")
    return out


def one(column: str, text: str | None) -> pl.Expr:
    return pl.when(ROW).then(pl.lit(text)).otherwise(pl.col(column)).alias(column)


@pytest.mark.parametrize(
    ("table", "column", "text", "problem"),
    [
        ("episodes", "progress", "nan", "row 3, column progress: nan is not a number"),
        ("episodes", "progress", "inf", "row 3, column progress: inf is not a number"),
        ("episodes", "watched_seat", "7", "row 3, column watched_seat: 7 is not from 0 to 1"),
        ("episodes", "tick_ms", "0", "row 3, column tick_ms: 0 is not from 1 to 60000"),
        ("ticks", "action_0", "900", "row 3, column action_0: 900 is not from 0 to 5"),
        ("ticks", "action_0", "up", "row 3, column action_0: up is not a whole number"),
        ("ticks", "late", "maybe", "row 3, column late: maybe is not true or false"),
    ],
)
def test_an_impossible_cell_is_named(
    exported: Path, tmp_path: Path, table: str, column: str, text: str | None, problem: str
) -> None:
    folder = edited(exported, tmp_path / "edited", table, one(column, text))
    with pytest.raises(ExportError) as error:
        read_export(folder)
    assert f"description-{table}_data.csv" in str(error.value)
    assert problem in str(error.value)
    assert str(error.value).endswith("Export the study again.")


@pytest.mark.parametrize(
    ("table", "key"), [("participants", "participant p"), ("episodes", "episode p"), ("ticks", "timestep 1")]
)
def test_a_row_that_is_there_twice_is_named(exported: Path, tmp_path: Path, table: str, key: str) -> None:
    """It would count twice without a sign."""
    with pytest.raises(ExportError, match=rf"{table}_data\.csv, rows 3 and \d+ are both .*{key}"):
        read_export(edited(exported, tmp_path / "edited", table, twice=True))


def test_empty_columns_of_ticks_are_read_without_a_codebook(exported: Path, tmp_path: Path) -> None:
    """In CSV, a column without values looks like text."""
    empty = [pl.lit(None, pl.String).alias(name) for name in (*INTENTIONS, "asked", "displayed_1", "in_sight")]
    export = read_export(edited(exported, tmp_path / "edited", "ticks", *empty))
    assert analyse(export, QUICK).rows
    assert export.ticks.schema["intention_1_x"] == pl.Int64


def test_blocks_are_analysed_without_the_study_file(exported: Path, tmp_path: Path) -> None:
    level = pl.when(pl.col("agent_1") == "sp").then(pl.lit("none")).otherwise(pl.lit("tom"))
    folder = edited(exported, tmp_path / "edited", "episodes", level.alias("factor_prediction"))
    assert repeated_factors(read_export(folder)) == {"prediction": ("none", "tom")}


@pytest.mark.usefixtures("no_pictures", "quick_command")
def test_the_report_names_the_changed_tables(
    exported: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    folder = edited(exported, tmp_path / "edited", "episodes")
    sums = [f"{hashlib.sha256(path.read_bytes()).hexdigest()}  {path.name}" for path in folder.glob("*.csv")]
    (folder / "SHA256SUMS").write_text("\n".join(sums) + "\n", encoding="utf-8")
    assert "SHA256SUMS" not in write_report(folder, tmp_path / "first", QUICK).page.read_text("utf-8")
    ticks = folder / "description-ticks_data.csv"
    ticks.write_text("".join(ticks.read_text("utf-8").splitlines(keepends=True)[:-20]), encoding="utf-8")
    assert kitchenmind.main(["report", str(folder), "--out", str(tmp_path / "second")]) == 0
    notice = "description-ticks_data.csv is not as it was exported (SHA256SUMS)."
    assert notice in capsys.readouterr().err
    assert notice in (tmp_path / "second" / "report.html").read_text("utf-8")
