"""An export has one column for each factor of all its studies and versions; a report sees those of its own study."""

from pathlib import Path

import numpy as np
import polars as pl
import pytest

import kitchenmind
from analysis.study import Options, analyse
from analysis.synthetic import Truth, write_export
from analysis.tables import read_export

QUICK = Options(power_studies=20, draws=50)
TABLES = ("participants", "episodes", "answers", "ticks")
IS_TOM = (pl.col("number") <= 2) == (pl.col("condition") == "order_2")  # of four rounds in two blocks
LEVEL = pl.when(IS_TOM).then(pl.lit("tom")).otherwise(pl.lit("none"))


def together(folder: Path, column_of_people: bool) -> Path:
    """Two studies in one export: `simulated` compares two conditions (`column_of_people`: they are levels of a factor),
    `blocks` has that factor within people."""
    arms = {"simulated": ("none", "tom"), "blocks": ("order_1", "order_2")}
    parts: dict[str, list[pl.DataFrame]] = {name: [] for name in TABLES}
    for study, conditions in arms.items():
        truth = Truth(participants=4, conditions=conditions, layouts=("matrix", "double_rings"), timesteps=20)
        write_export(truth, folder / study)
        for name in TABLES:
            table = pl.read_parquet(folder / study / f"{name}.parquet")
            texts = [column for column, kind in table.schema.items() if kind in (pl.Categorical, pl.Enum)]
            ids = [column for column in ("participant", "participant_0", "episode") if column in table.columns]
            table = table.with_columns(pl.col(texts).cast(pl.String))
            table = table.with_columns((pl.lit(study) + pl.col(column)).alias(column) for column in ids)
            if name == "participants":
                table = table.with_columns(study=pl.lit(study))
            if study == "blocks" and name == "episodes":
                table = table.with_columns(factor_prediction=LEVEL)
            if study != "blocks" and column_of_people and name in ("participants", "episodes"):
                table = table.with_columns(factor_prediction=pl.col("condition").cast(pl.String))
            parts[name].append(table)
    for name, tables in parts.items():
        pl.concat(tables, how="diagonal_relaxed").write_parquet(folder / f"{name}.parquet")
    return folder


def test_blocks_of_another_study_do_not_take_the_comparison_of_conditions_away(tmp_path: Path) -> None:
    folder = together(tmp_path, column_of_people=False)
    made = analyse(read_export(folder, study="simulated"), QUICK)
    assert (made.within, made.contrast) == ((), ("tom", "none"))
    assert [row for row in made.rows if row.section == "factorial"] == []
    assert made.powers


def test_levels_between_people_of_another_study_do_not_hide_those_within_people(tmp_path: Path) -> None:
    folder = together(tmp_path, column_of_people=True)
    made = analyse(read_export(folder, study="blocks"), QUICK)
    assert (made.within, made.contrast) == (("prediction",), None)
    assert any(row.contrast == "prediction" for row in made.rows if row.section == "factorial")


def test_the_power_of_a_study_does_not_stumble_over_the_factors_of_another(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    folder = together(tmp_path, column_of_people=True)
    path = folder / "participants.parquet"
    people = pl.read_parquet(path).with_columns(factor_steps=pl.when(pl.col("study") == "blocks").then(pl.lit("one")))
    people.write_parquet(path)
    words = ["power", str(folder), "--study", "simulated", "--effect", "8", "--studies", "20"]
    assert kitchenmind.main([*words, "--out", str(tmp_path / "power")]) == 0
    assert "steps" not in capsys.readouterr().out


@pytest.mark.parametrize("dropped", ["none", "random", "tom"])
def test_people_of_a_version_with_more_levels_within_people_count_with_those_that_are_left(
    tmp_path: Path, dropped: str
) -> None:
    """Version 1 had three blocks, in two orders; version 2 has the two that are left."""
    levels = ("none", "random", "tom")
    left = [level for level in levels if level != dropped]
    write_export(Truth(participants=6, conditions=("order_1", "order_2"), layouts=("matrix",), timesteps=20), tmp_path)
    people = pl.read_parquet(tmp_path / "participants.parquet")
    people = people.with_row_index("row").with_columns(study_version=pl.col("row") % 2 + 1).drop("row")
    people.write_parquet(tmp_path / "participants.parquet")
    version = dict(people.select("participant", "study_version").iter_rows())
    rounds, chance = [], np.random.default_rng(4)
    for episode in pl.read_parquet(tmp_path / "episodes.parquet").filter(pl.col("agent_1") == "sp").to_dicts():
        met = levels if version[episode["participant_0"]] == 1 else left
        met = met[::-1] if episode["condition"] == "order_2" else met
        for number, level in enumerate(met, start=1):
            name = f"{episode['episode']}-{number}"
            score = 40 + 10 * levels.index(level) + int(chance.integers(6))
            rounds.append(episode | {"episode": name, "number": number, "factor_prediction": level, "score": score})
    pl.DataFrame(rounds).write_parquet(tmp_path / "episodes.parquet")
    (tmp_path / "studies").mkdir()
    for number, named in ((1, levels), (2, left)):
        text = f"factors:\n  prediction: [{', '.join(named)}]\ncells: {{within: [prediction]}}\n"
        (tmp_path / "studies" / f"simulated_version-{number}.yaml").write_text(text)
    made = analyse(read_export(tmp_path), QUICK)
    assert made.conditions == ("order_1", "order_2")
    (row,) = (row for row in made.rows if row.section == "factorial" and row.test == "difference" and not row.question)
    assert (row.contrast, row.n, row.note) == ("prediction", 12, f"({left[1]} - {left[0]})")
    assert row.estimate == pytest.approx(10 * (levels.index(left[1]) - levels.index(left[0])), abs=4)
