"""An export of a database: every table, column, row and file, from both kinds of database."""

import json
from pathlib import Path
from typing import Any

import polars as pl
from sqlalchemy import Connection, select

import kitchenmind
from server.export import codebook, data_dictionary
from server.store import answers, episodes, interventions, participants, studies, tables, ticks
from server.store.database import Database
from server.store.tables import answers as answer_table
from server.store.tables import episodes as episode_table
from server.store.tables import metadata
from tests.support.exported import TABLES, Exported, csv_rows, of_any_kind, parquet
from tests.support.study_data import fill, new_participant, played

ROOT = Path(__file__).resolve().parents[3]


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
    assert parquet(folder, "pauses")["seat"].to_list() == [0] * 6


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


def test_exclusions_are_shown_with_their_episode_or_participant_until_undone(
    filled: Database, exported: Exported
) -> None:
    first, second = filled.read_now(participants.of_study, 1)[:2]
    episode = filled.read_now(episodes.of_participant, second.id)[0].id
    taken_back = filled.write_now(interventions.exclude, second.id, None, ("idle", ""), "anna")
    filled.write_now(interventions.restore, taken_back, "anna")
    filled.write_now(interventions.exclude, first.id, None, ("no interaction", "sat there"), "anna")
    filled.write_now(interventions.exclude, second.id, episode, ("stuck", ""), "anna")
    folder = exported()
    people = parquet(folder, "participants")
    assert dict(people.select("participant", "excluded").iter_rows())[first.id] == "no interaction"
    assert people["excluded"].null_count() == 2
    excluded = parquet(folder, "episodes").filter(pl.col("excluded").is_not_null())
    assert excluded.select("episode", "excluded").rows() == [(episode, "stuck")]
    assert parquet(folder, "exclusions")["reason"].to_list() == ["no interaction", "idle", "stuck"]
    assert "anna" not in (folder / "data" / "description-exclusions_data.csv").read_text()
