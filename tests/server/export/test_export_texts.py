"""Texts in an export: exact, and not a formula in any spreadsheet."""

import csv
from datetime import UTC, datetime
from pathlib import Path

import polars as pl
import pyarrow.parquet
import pytest
from sqlalchemy import select

from analysis.spreadsheet import safe_text
from server.export import files as export_files
from server.export import tick_rows
from server.export.spreadsheet_text import unescaped
from server.store import participants
from server.store.database import Database
from server.store.tables import participants as participant_table
from tests.support.exported import TABLES, Exported, csv_rows, of_any_kind, parquet


def test_nothing_personal_is_in_any_file(filled: Database, exported: Exported) -> None:
    person = filled.read_now(participants.of_study, 1)[0]
    filled.write_now(participants.add_personal, person.id, 1, "contact", "somebody@example.org")
    hashes = filled.read_now(
        lambda connection: list(connection.execute(select(participant_table.c.token_hash)).scalars())
    )
    for path in exported("--format", "csv").rglob("*"):
        if path.is_file():
            content = path.read_text(encoding="utf-8")
            for word in ("PROLIFICring", "somebody@example.org", "KM-1234", *hashes):
                assert word not in content, path


@of_any_kind
def test_texts_are_safe_for_spreadsheets_and_numbers_stay_exact(filled: Database, exported: Exported) -> None:
    folder = exported()
    said = {(row["question"], row["value"]) for row in csv_rows(folder, "answers")}
    assert ("comment", "'=1+1") in said
    assert ("predictor", "-1") in said
    assert "=1+1" in parquet(folder, "answers")["value"].to_list()
    assert "'=1+1" not in parquet(folder, "answers")["value"].to_list()
    for table in TABLES:
        frame = parquet(folder, table)
        for row in csv_rows(folder, table):
            for column, kind in frame.schema.items():
                if kind == pl.String and not row[column].lstrip("-").isdigit():
                    assert not row[column].startswith(("=", "+", "-", "@", "\t", "\r"))


@pytest.mark.parametrize(
    "text",
    [
        "=1+1",
        "+49 30",
        "-x",
        "@SUM(A1)",
        "\ttab",
        "\rline",
        "'=1",
        "''-a",
        "＝1+1",
        "＋49",
        "－x",
        "＠SUM(A1)",
        "−1 is colder",
        "x;=1+1",
        "x; '=1+1",
        'x;"=1+1"',
        "a\n=1+1",
        "a\t@b;\t-c;;+d",
        "\t=1",
        "\r\n'\n=1",
        "1;-2",
        "plain",
        "it's",
        "",
        "-1",
        "1e5",
        "'",
        "\x00x",
        "  =1",
        "\u3000＝1",
        "\ufeff\u200b@x",
        "  '=1",
        "x; \u00a0+1",
    ],
)
def test_escaped_text_comes_back_as_it_was(text: str) -> None:
    escaped: str = export_files.escaped(pl.DataFrame({"value": [text]}))["value"][0]
    assert unescaped(escaped) == text
    assert safe_text(text) == escaped, "the analysis writes its files by the same rule"
    seen = escaped.lstrip(" \u00a0\u200b\u3000\ufeff")
    assert escaped in ("-1",) or not seen.startswith(tuple("=+-@\t\r\x00＝＋－＠"))


@pytest.mark.parametrize("separator", [",", ";", "\t"])
def test_no_spreadsheet_of_any_country_finds_a_formula_in_a_text(separator: str, tmp_path: Path) -> None:
    """With a semicolon between cells, as in much of Europe, quotes in the middle of a line protect nothing."""
    signs = "=+-@\t\r＝＋－＠"
    texts = [
        f"{before}{sign}1+1" for sign in signs for before in ("", " ", "x;", "x; ", 'x;"', "x\t", "x\n", "x;;", "x;\t")
    ]
    table = pl.DataFrame({"number": range(len(texts)), "text": texts})
    (tmp_path / "data").mkdir()
    with export_files.TableWriter(tmp_path, "csv", "answers", table.schema) as writer:
        writer.write(table)
    path = export_files.table_path(tmp_path, "csv", "answers")
    with path.open(encoding="utf-8", newline="") as file:
        cells = [cell for row in csv.reader(file, delimiter=separator) for cell in row]
    found = [cell for cell in cells if cell.lstrip(' "').startswith(tuple("=+-@＝＋－＠"))]
    assert found == []


def test_a_csv_file_has_quotes_around_texts_alone_and_whole_numbers_without_a_point(tmp_path: Path) -> None:
    at = datetime(2026, 1, 2, 3, 4, 5, 600, UTC)
    columns = [["a", 'x"y,\n', "", None], [1, None, -3, 4], [2.0, 0.1, 1e-7, None], [True, None, False, True], [at] * 4]
    kinds = (pl.String(), pl.Int16(), pl.Float64(), pl.Boolean(), pl.Datetime("us", "UTC"))
    table = pl.DataFrame([pl.Series(name, *of) for name, *of in zip("tnfba", columns, kinds, strict=True)])
    with export_files.TableWriter(tmp_path, "csv", "answers", table.schema) as writer:
        writer.write(table[:2])
        writer.write(table[2:])
    assert export_files.table_path(tmp_path, "csv", "answers").read_text("utf-8") == (
        '"t","n","f","b","a"\n'
        '"a",1,2,true,2026-01-02 03:04:05.000600Z\n'
        '"x""y,\n",,0.1,,2026-01-02 03:04:05.000600Z\n'
        '"",-3,1e-7,false,2026-01-02 03:04:05.000600Z\n'
        ",4,,true,2026-01-02 03:04:05.000600Z\n"
    )


@of_any_kind
def test_arrow_as_r_uses_it_reads_the_same_rows_and_types(
    filled: Database, exported: Exported, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(tick_rows, "EPISODES", 1)  # so that the file is put together from several chunks
    folder = exported()
    assert list((folder / "parquet").glob("*.part")) == []
    table = pyarrow.parquet.read_table(folder / "parquet" / "ticks.parquet")
    kinds = {field.name: str(field.type).removeprefix("large_") for field in table.schema}
    kinds_of_some = {"episode": "string", "timestep": "int32", "p1_north": "float", "late": "bool"}
    assert {name: kinds[name] for name in kinds_of_some} == kinds_of_some
    assert (kinds["action_0"], kinds["made_at"]) == ("int16", "timestamp[us, tz=UTC]")
    assert table.to_pylist() == parquet(folder, "ticks").to_dicts()
    rows = csv_rows(folder, "ticks")
    assert [(row["episode"], int(row["timestep"])) for row in rows] == [
        (row["episode"], row["timestep"]) for row in table.to_pylist()
    ]
