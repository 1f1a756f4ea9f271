"""What is exported can be analysed: the report is made of a database that the real rules filled."""

import hashlib
import json
import shutil
from collections.abc import Iterator
from pathlib import Path

import polars as pl
import pytest
from sqlalchemy import select

import kitchenmind
from analysis import data_quality, measures, model_cards
from analysis.episode_quality import episode_proposals
from analysis.report import write_report
from analysis.study import Options
from analysis.table_files import COLUMNS, OPTIONAL, table_file
from analysis.tables import export_of, read_export
from server.export import codebook, quality_inputs
from server.store import interventions, participants
from server.store.database import Database
from server.store.migrate import migrate
from server.store.tables import answers as answer_table
from server.store.tables import episodes as episode_table
from server.store.tables import participants as participant_table
from server.store.tables import ticks as tick_table
from tests.support.study_data import fill

PEOPLE = 9


@pytest.fixture(scope="module")
def database(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Database]:
    """Nine people of three conditions who finished, two episodes each."""
    address = f"sqlite:///{tmp_path_factory.mktemp('store')}/study.db"
    migrate(address)
    with Database(address) as opened:
        opened.write_now(fill, PEOPLE)
        query = select(participant_table.c.id)
        for person in opened.read_now(lambda connection: connection.execute(query).scalars().all()):
            opened.write_now(participants.complete, person, "KM-1")
        yield opened


@pytest.fixture(scope="module", params=["csv", "parquet"])
def folder(request: pytest.FixtureRequest, database: Database, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The database exported in one format alone."""
    out = tmp_path_factory.mktemp("export") / "data"
    url = database.url
    assert kitchenmind.main(["export", "--database", url, "--out", str(out), "--format", request.param]) == 0
    return out


def test_the_analysis_reads_only_columns_of_the_codebook() -> None:
    tables = {table.name: set(table.names) for table in codebook.TABLES}
    assert set(OPTIONAL) <= set(COLUMNS) <= set(tables)
    for table, columns in COLUMNS.items():
        assert set(columns) <= tables[table]


def test_a_csv_file_has_the_same_columns_without_values_or_rows(folder: Path, tmp_path: Path) -> None:
    """As `watched_seat` of pairs of people: read from its values alone, an empty column is text."""
    if (folder / "parquet").exists():
        pytest.skip("Parquet files have their types")
    path = table_file(folder, "episodes")
    assert path is not None
    for name, change in (("column", {"watched_seat": pl.lit("")}), ("rows", {})):
        copy = tmp_path / name
        shutil.copytree(folder, copy)
        table = pl.read_csv(path, infer_schema=False).with_columns(**change)
        table.head(len(table) if change else 0).write_csv(copy / path.relative_to(folder))
        export = read_export(copy)
        assert export.episodes.schema["watched_seat"] == pl.Int64
        assert len(export.episodes) == (2 * PEOPLE if change else 0)


def test_accuracy_from_the_export_is_accuracy_counted_in_the_database(folder: Path, database: Database) -> None:
    episodes = measures.episode_measures(read_export(folder))
    assert episodes.height == 2 * PEOPLE
    episode = episodes["episode"][0]
    query = select(tick_table.c.timestep, tick_table.c.action_1, tick_table.c.prediction)
    query = query.where(tick_table.c.episode_id == episode).order_by(tick_table.c.timestep)
    rows = database.read_now(lambda connection: connection.execute(query).all())
    hits = {1: [], 2: [], 3: []}  # type: dict[int, list[bool]]
    done = {timestep: action for timestep, action, _ in rows}  # the action that led to state n stands in tick n
    for timestep, _, prediction in rows:
        for step in (1, 2, 3):
            if prediction and timestep + step in done:
                guesses = memoryview(prediction).cast("f")[6 * (step - 1) : 6 * step].tolist()
                hits[step].append(guesses.index(max(guesses)) == done[timestep + step])
    for step in (1, 2, 3):
        assert episodes[f"accuracy_{step}"][0] == pytest.approx(sum(hits[step]) / len(hits[step]))


def test_reward_and_pauses_come_through(folder: Path, database: Database) -> None:
    episodes = measures.episode_measures(read_export(folder))
    query = select(episode_table.c.id, episode_table.c.score, episode_table.c.progress)
    stored = {row[0]: row[1] + row[2] for row in database.read_now(lambda connection: connection.execute(query).all())}
    assert dict(episodes.select("episode", "reward").rows()) == stored
    assert episodes["hidden_share"].to_list() == pytest.approx([1234.5 / (40 * 200 + 1234.5)] * 2 * PEOPLE)
    assert episodes["lag_ms"].null_count() == 0


def test_an_exported_study_becomes_a_report(folder: Path, tmp_path: Path) -> None:
    report = write_report(folder, tmp_path, Options(power_studies=20, draws=200))
    assert report.analysis.conditions == ("none", "random", "tom")
    assert report.analysis.episodes.height == 2 * PEOPLE
    assert "Simulated" not in report.page.read_text(encoding="utf-8")


def test_offline_accuracy_is_found_by_the_hash_of_the_predictor(tmp_path: Path) -> None:
    for name, share in (("sp_predictor_window", 0.8), ("sp_predictor_stream", 0.9)):
        card = tmp_path / "matrix" / name
        card.mkdir(parents=True)
        accuracy = {"step1": share, "step2": share - 0.1, "step3": share - 0.2, "mean": share - 0.1}
        (card / "config.json").write_text(json.dumps({"accuracy": accuracy}))
        (card / "sha256").write_text(f"{name}\n")
    used = hashlib.sha256(b"sp_predictor_stream\n").hexdigest()
    other = hashlib.sha256(b"sp_predictor_window\n").hexdigest()
    episodes = pl.DataFrame(
        {
            "agent": ["sp", "sp", "sp", "fcp"],
            "predictor": ["sp_predictor_stream", "sp_predictor_window", "sp_predictor_stream@40", "mine"],
            "layout": "matrix",
            "predictor_sha256": [used, other, used, "0" * 64],  # a degraded predictor is the same file
        }
    )
    assert model_cards.offline_accuracy(episodes, tmp_path) == {
        "sp": {
            "sp_predictor_stream": {"matrix": pytest.approx([0.9, 0.8, 0.7])},
            "sp_predictor_window": {"matrix": pytest.approx([0.8, 0.7, 0.6])},
        }
    }
    assert model_cards.offline_accuracy(episodes.drop("predictor_sha256"), tmp_path) == {}
    people = episodes.with_columns(
        watched_person=pl.when(pl.col("predictor") == "sp_predictor_stream").then(pl.lit("p2"))
    )
    found = model_cards.offline_accuracy(people, tmp_path)
    assert list(found["sp"]) == ["sp_predictor_window"], "no offline test is about people"


def test_the_example_of_the_guide_runs_and_finds_the_same_accuracy(
    database: Database, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    assert kitchenmind.main(["export", "--database", database.url, "--out", "data"]) == 0
    path = tmp_path / "data" / "parquet" / "episodes.parquet"
    first = pl.when(pl.int_range(pl.len()) == 0).then(pl.lit("tutorial")).otherwise("kind")
    pl.read_parquet(path).with_columns(kind=first).write_parquet(path)
    guide = Path(__file__).parents[3] / "docs/guides/read_the_data.md"
    code = guide.read_text(encoding="utf-8").split("```python accuracy.py\n")[1].split("```")[0]
    names: dict[str, pl.DataFrame] = {}
    exec(compile(code, guide.name, "exec"), names)
    third = names["ticks"].select(pl.col("predicted_3") == pl.col("partner").shift(-2).over("episode")).to_series()
    hits = measures.prediction_hits(read_export(tmp_path / "data").ticks)
    assert third.mean() == pytest.approx(hits.filter(step=3)["hit"].mean())


def test_the_dashboard_and_the_report_propose_the_same_for_each_episode(folder: Path, database: Database) -> None:
    report = data_quality.proposals(measures.episode_measures(read_export(folder)), read_export(folder).answers)
    wanted = {row["episode"]: (row["proposal"], row["rules"] or "") for row in report.to_dicts()}
    found = {}
    for episode in wanted:  # one at a time, as the dashboard checks them
        found |= episode_proposals(database.read_now(quality_inputs.tables, [episode]), [episode])
    assert found == wanted
    assert len(wanted) == 2 * PEOPLE


def test_the_dashboard_counts_the_same_answers_over_all_episodes_of_a_person(tmp_path: Path) -> None:
    """It checks a few episodes at a time, and the rule is about three or more."""
    address = f"sqlite:///{tmp_path}/study.db"
    migrate(address)
    with Database(address) as opened:
        opened.write_now(fill, 1, per_person=3)
        alike = answer_table.update().where(answer_table.c.question_key == "predictor").values(value=7)
        opened.write_now(lambda connection: connection.execute(alike))
        (episode, *_), *_ = opened.read_now(quality_inputs.over, (1,))
        tables = opened.read_now(quality_inputs.tables, [episode])
        proposals = episode_proposals(tables, [episode])
    assert list(proposals) == [episode]
    assert "same answers" in proposals[episode][1]
    assert tables["ticks"]["episode"].unique().to_list() == [episode], "only what is asked for"


def test_the_dashboard_knows_at_which_states_pauses_were_for_the_lag_of_keys(folder: Path, database: Database) -> None:
    wanted = measures.episode_measures(read_export(folder)).select("episode", "lag_ms").sort("episode")
    found = export_of(database.read_now(quality_inputs.tables, wanted["episode"].to_list()), folder, "")
    assert found.pauses.height
    assert measures.episode_measures(found).select("episode", "lag_ms").sort("episode").equals(wanted)


def test_what_the_researcher_excludes_is_left_out_and_listed(database: Database, tmp_path: Path) -> None:
    over = database.read_now(quality_inputs.over, (1,))
    (episode, first, _), (_, second, _) = over[0], next(key for key in over if key[1] != over[0][1])
    numbers = [
        database.write_now(interventions.exclude, first, episode, ("not attentive", "saw it myself"), "anna"),
        database.write_now(interventions.exclude, second, None, ("technical fault", ""), "anna"),
    ]
    try:
        words = ["export", "--database", str(database.url), "--out", str(tmp_path / "data")]
        assert kitchenmind.main(words) == 0
    finally:
        for number in numbers:
            database.write_now(interventions.restore, number, "anna")
    report = write_report(tmp_path / "data", tmp_path / "report", Options(power_studies=20, draws=200))
    kept = set(report.analysis.episodes["episode"])
    gone = {key[0] for key in over if key[0] == episode or key[1] == second}
    assert kept == {key[0] for key in over} - gone
    page = report.page.read_text(encoding="utf-8")
    assert "not attentive" in page
    assert "technical fault" in page
