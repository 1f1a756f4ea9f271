import csv
import json
import subprocess
import sys
import warnings
from collections.abc import Callable
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import polars as pl
import pyarrow.parquet
import pytest
from sqlalchemy import Connection, select

import kitchenmind
from analysis.spreadsheet import safe_text
from overcooked.trajectory import read_trajectories
from server.export import codebook, data_dictionary, tick_rows
from server.export import files as export_files
from server.export.spreadsheet_text import unescaped
from server.store import answers, decisions, episodes, participants, studies, tables, ticks
from server.store.database import Database
from server.store.tables import answers as answer_table
from server.store.tables import episodes as episode_table
from server.store.tables import metadata
from server.store.tables import participants as participant_table
from tests.support.study_data import fill, new_participant, played

ROOT = Path(__file__).resolve().parents[3]
TABLES = [table.name for table in codebook.TABLES]
Exported = Callable[..., Path]
# What is written after the rows have been read is the same for every kind of database.
of_any_kind = pytest.mark.parametrize("url", ["sqlite"], indirect=True)


@pytest.fixture
def exported(url: str, tmp_path: Path) -> Exported:
    """Export the database of this test into a folder."""

    def run(*words: str, name: str = "out") -> Path:
        folder = tmp_path / name
        assert kitchenmind.main(["export", "--database", url, "--out", str(folder), *words]) == 0
        return folder

    return run


def parquet(folder: Path, table: str) -> pl.DataFrame:
    return pl.read_parquet(folder / "parquet" / f"{table}.parquet")


def csv_rows(folder: Path, table: str) -> list[dict[str, str]]:
    with (folder / "data" / f"description-{table}_data.csv").open(newline="", encoding="utf-8") as file:
        return list(csv.DictReader(file))


def test_every_table_is_written_in_both_formats_with_the_same_columns_and_rows(
    filled: Database, exported: Exported
) -> None:
    folder = exported()
    counts = {}
    for table in TABLES:
        frame = parquet(folder, table)
        rows = csv_rows(folder, table)
        assert len(rows) == frame.height
        assert not rows or list(rows[0]) == frame.columns
        counts[table] = frame.height
    assert counts["participants"] == 3
    assert counts["episodes"] == 6
    assert counts["ticks"] == 6 * 40
    assert counts["answers"] == 3 * (3 + 2 * 2)
    assert counts["inputs"] == 6 * 40 * 3
    assert counts["pauses"] == 6


def test_inputs_are_exported_with_the_timestep_as_ticks_count_it_and_what_became_of_them(
    filled: Database, exported: Exported
) -> None:
    folder = exported()
    inputs, steps = parquet(folder, "inputs"), parquet(folder, "ticks")
    applied = inputs.filter(pl.col("outcome") == "applied")
    joined = applied.join(steps, on=["episode", "timestep"], how="inner")
    assert joined.height == applied.height == 6 * 40
    assert (joined["seq"] == joined["key_seq_0"]).all()
    dropped = inputs.filter(pl.col("outcome") != "applied")
    assert dropped["timestep"].null_count() == dropped.height
    assert set(dropped["outcome"]) == {"repeated", "stood_still"}
    assert inputs.filter(pl.col("outcome") == "stood_still")["received_ms"].null_count() == 6 * 40
    assert steps["made_at"].null_count() == 0
    assert str(steps["made_at"].dtype) == "Datetime(time_unit='us', time_zone='UTC')"


@of_any_kind
def test_every_column_is_in_the_codebook_with_type_and_meaning(filled: Database, exported: Exported) -> None:
    folder = exported()
    book = json.loads((folder / "codebook.json").read_text())["tables"]
    described = {
        variable["name"]
        for variable in json.loads((folder / "dataset_description.json").read_text())["variableMeasured"]
    }
    for table in TABLES:
        columns = parquet(folder, table).columns
        assert columns == list(book[table]["columns"])
        assert set(columns) <= described
        for column in book[table]["columns"].values():
            assert column["type"] in codebook.TYPES
            assert column["meaning"].endswith(".")


def test_data_dictionary_has_every_table_and_column_of_export_and_database() -> None:
    page = (ROOT / "docs" / "reference" / "data_dictionary.md").read_text(encoding="utf-8")
    assert page == data_dictionary.text(), "python -m server.export.data_dictionary > docs/reference/data_dictionary.md"
    assert set(tables.TABLES) == set(metadata.tables.values())
    for table in metadata.tables.values():
        for column in table.columns:
            assert f"| `{column.name}` |" in page
            assert column.doc


def test_row_of_a_timestep_has_the_state_before_and_what_was_done_in_it(filled: Database, exported: Exported) -> None:
    frame = parquet(exported(), "ticks")
    episode = frame["episode"][0]
    stored = filled.read_now(ticks.of_episode, episode)
    rows = frame.filter(pl.col("episode") == episode).to_dicts()
    assert [row["timestep"] for row in rows] == list(range(40))
    for row, before, after in zip(rows, stored[:-1], stored[1:], strict=True):
        assert row["state_hash"] == before.state_hash
        assert (row["action_0"], row["action_1"]) == after.actions
        assert (row["reward_0"], row["shaped_1"], row["events_0"]) == (
            after.rewards[0],
            after.shaped[1],
            after.events[0],
        )
        assert (row["decided_0"], row["decided_1"], row["late"]) == (*before.next_actions, before.late)
        assert row["decided_1"] == row["action_1"]
        flat = [row[f"p{step}_{name}"] for step in codebook.STEPS for name in codebook.ACTION_NAMES]
        assert flat == ([p for step in before.prediction for p in step] or [None] * 18)
        best = [max(range(6), key=step.__getitem__) for step in before.prediction] or [None] * 3
        assert [row[f"predicted_{step}"] for step in codebook.STEPS] == best
        drawn = tuple((row[f"displayed_{step}"], row[f"opacity_{step}"]) for step in codebook.STEPS)
        assert drawn == before.displayed
        assert (row["scheduled_ms"], row["late_ms"], row["models_ms"]) == (
            before.scheduled_ms,
            before.late_ms,
            before.models_ms,
        )
        assert (row["key_seq_0"], row["key_client_ms_0"]) == (after.keys[0].seq, after.keys[0].client_ms)
        assert row["key_seq_1"] is None


@of_any_kind
def test_last_state_and_what_was_recorded_about_it_stand_in_episodes(filled: Database, exported: Exported) -> None:
    row = parquet(exported(), "episodes").to_dicts()[0]
    last = filled.read_now(ticks.of_episode, row["episode"])[-1]
    kept = json.loads(row["last_tick"])
    assert kept["state_hash"] == row["final_hash"] == last.state_hash
    assert (kept["late_ms"], kept["displayed"]) == (last.late_ms, [list(step) for step in last.displayed])
    assert row["timesteps"] == 40
    assert json.loads(row["spec"])["grid"].count("\n") == 4


def test_running_episode_exports_the_timesteps_that_are_over(database: Database, exported: Exported) -> None:
    def begin(connection: Connection) -> None:
        fill(connection, people=1, per_person=1, timesteps=0)

    database.write_now(begin)
    episode = database.read_now(lambda connection: connection.execute(select(episode_table.c.id)).scalar_one())
    database.write_now(ticks.insert, played(episode, 3, seed=1))
    folder = exported()
    assert parquet(folder, "ticks").height == 3
    assert parquet(folder, "episodes")["timesteps"][0] == 3


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


def test_one_study_of_several_is_exported_alone(filled: Database, exported: Exported) -> None:
    filled.write_now(fill, people=1, key="matrix")
    folder = exported("--study", "matrix")
    for table in ("participants", "episodes", "studies"):
        assert set(parquet(folder, table)["study"]) == {"matrix"}
    assert parquet(folder, "ticks").height == 2 * 40
    assert parquet(folder, "events").height == 3
    assert [path.name for path in (folder / "studies").iterdir()] == ["matrix_version-1.yaml"]
    assert parquet(exported(name="all"), "participants").height == 4


def test_empty_database_gives_all_files_with_headers(database: Database, exported: Exported) -> None:
    folder = exported()
    for table in TABLES:
        assert parquet(folder, table).height == 0
        assert (folder / "data" / f"description-{table}_data.csv").read_text().startswith('"')


@of_any_kind
def test_participants_table_is_wide(filled: Database, exported: Exported) -> None:
    row = parquet(exported(), "participants").to_dicts()[0]
    assert (row["layout_1"], row["agent_2"]) == ("coordination_ring", "sp")
    assert row["answer_questions-01_partner"] == "7"
    assert json.loads(row["answer_end_ways"]) == ["a", "-b"]
    assert row["answer_end_agree"] == "true"


@of_any_kind
def test_levels_of_factors_stand_with_each_participant(database: Database, exported: Exported) -> None:
    def take_part(connection: Connection) -> None:
        factors = "factors: {prediction: [none, tom], opacity: {off: {}, on: {confidence_opacity: true}}}\n"
        for text, conditions in ((factors, ("tom_off", "none_on")), ("conditions: []\n", ("tom",)), ("[", ("tom",))):
            study = studies.register(connection, "crossed", text)
            for condition in conditions:
                new_participant(connection, study.id, condition)

    database.write_now(take_part)
    folder = exported()
    people = kitchenmind.load(folder).participants.select("condition", "factor_prediction", "factor_opacity")
    written = [("tom_off", "tom", "off"), ("none_on", "none", "on"), ("tom", None, None), ("tom", None, None)]
    assert people.rows() == written
    columns = json.loads((folder / "codebook.json").read_text("utf-8"))["tables"]["participants"]["columns"]
    assert columns["factor_opacity"]["meaning"].startswith("Level of this factor")
    assert [row["factor_opacity"] for row in csv_rows(folder, "participants")] == ["off", "on", "", ""]


def test_answers_keep_what_they_were(filled: Database, exported: Exported) -> None:
    person = filled.read_now(participants.of_study, 1)[1].id
    values: dict[str, Any] = {"nothing": None, "text": "7", "number": 7.25, "none": False}
    filled.write_now(answers.save, answers.SubmittedPage(person, "more", values))
    rows = parquet(exported(), "answers").filter(pl.col("step") == "more").to_dicts()
    assert [(row["value"], row["value_type"]) for row in rows] == [
        (None, "null"),
        ("7", "text"),
        ("7.25", "number"),
        ("false", "boolean"),
    ]
    assert filled.read_now(lambda c: c.execute(select(answer_table)).all())


def test_exclusions_stand_at_what_they_are_about_until_they_are_taken_back(
    filled: Database, exported: Exported
) -> None:
    first, second = filled.read_now(participants.of_study, 1)[:2]
    episode = filled.read_now(episodes.of_participant, second.id)[0].id
    taken_back = filled.write_now(decisions.exclude, second.id, None, ("idle", ""), "anna")
    filled.write_now(decisions.restore, taken_back, "anna")
    filled.write_now(decisions.exclude, first.id, None, ("no interaction", "sat there"), "anna")
    filled.write_now(decisions.exclude, second.id, episode, ("stuck", ""), "anna")
    folder = exported()
    people = parquet(folder, "participants")
    assert dict(people.select("participant", "excluded").iter_rows())[first.id] == "no interaction"
    assert people["excluded"].null_count() == 2
    excluded = parquet(folder, "episodes").filter(pl.col("excluded").is_not_null())
    assert excluded.select("episode", "excluded").rows() == [(episode, "stuck")]
    assert parquet(folder, "exclusions")["reason"].to_list() == ["no interaction", "idle", "stuck"]
    assert "anna" not in (folder / "data" / "description-exclusions_data.csv").read_text()


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
