"""A report says if an agent or a predictor was another one in some rounds of the same kitchen."""

from pathlib import Path

import polars as pl
import pytest

from analysis.changed_models import changed_models, models_notice
from analysis.report import write_report
from analysis.study import Options
from analysis.tables import read_export
from tests.analysis.test_report import copied


def rounds(*shas: str | None) -> pl.DataFrame:
    """Rounds of an agent on Matrix, with the hash of its weights."""
    return pl.DataFrame({"agent_1": "sp", "agent_1_sha256": shas, "layout": "matrix"})


def test_an_agent_with_other_weights_is_found_with_its_rounds() -> None:
    assert changed_models(rounds("a", "a", "b")) == [("sp", "matrix", [2, 1])]


def test_the_same_weights_and_rounds_without_a_hash_are_no_change() -> None:
    assert changed_models(rounds("a", "a")) == []
    assert changed_models(rounds("a", None, "")) == []
    assert changed_models(rounds("a", "b").drop("agent_1_sha256")) == []


def test_an_agent_may_differ_from_kitchen_to_kitchen() -> None:
    elsewhere = rounds("b").with_columns(layout=pl.lit("double_rings"))
    assert changed_models(pl.concat([rounds("a"), elsewhere])) == []


@pytest.mark.usefixtures("no_pictures")
def test_the_report_names_what_changed(planted_folder: Path, tmp_path: Path) -> None:
    def change(name: str, table: pl.DataFrame) -> pl.DataFrame:
        if name != "episodes":
            return table
        early = pl.int_range(pl.len()) < 100
        return table.with_columns(predictor=pl.lit("tom"), predictor_sha256=pl.when(early).then(pl.lit("a")))

    folder = copied(planted_folder, tmp_path / "same", change)
    assert models_notice(read_export(folder)) == ""

    def again(name: str, table: pl.DataFrame) -> pl.DataFrame:
        return table.with_columns(pl.col("predictor_sha256").fill_null("b")) if name == "episodes" else table

    made = write_report(copied(folder, tmp_path / "other", again), tmp_path / "report", Options(power_studies=20))
    page = made.page.read_text(encoding="utf-8")
    assert "The weights of an agent or a predictor changed during the study" in page
    assert "tom in Coordination Ring (" in page
