"""A study that uses published scales by name, walked, exported and scored."""

from pathlib import Path

import polars as pl
import pytest

from tests.server.bots.test_bots import SCRIPTED
from tests.support.command_line import run

AFTER = "      - {key: partner, type: scale,"
MOOD = "      - {key: mood, type: scale,"


@pytest.mark.slow
@pytest.mark.timeout(1200)
def test_bots_answer_scales_and_the_report_scores_them(tmp_path: Path) -> None:
    study, database = tmp_path / "small.yaml", f"sqlite:///{tmp_path / 'kept.sqlite3'}"
    text = SCRIPTED.read_text("utf-8").replace(AFTER, f"      - {{type: published, scale: nasa_tlx_raw}}\n{AFTER}")
    study.write_text(text.replace(MOOD, f"      - {{type: published, scale: trust_in_automation}}\n{MOOD}"), "utf-8")
    walked = run("bots", "4", "--study", str(study), "--database", database, "--fast")
    assert walked.returncode == 0, walked.stderr
    exported = run("export", "--database", database, "--out", str(tmp_path / "data"))
    assert exported.returncode == 0, exported.stderr
    reported = run("report", str(tmp_path / "data"), "--out", str(tmp_path / "report"))
    assert reported.returncode == 0, reported.stderr
    scores = pl.read_csv(tmp_path / "report" / "scores.csv")
    answers = pl.read_parquet(tmp_path / "data" / "parquet" / "answers.parquet")
    answers = answers.with_columns(pl.col("participant", "step", "question", "value").cast(pl.String))
    workload = answers.filter(pl.col("question").str.starts_with("tlx_"))
    assert set(workload["value"]) <= {str(5 * place) for place in range(21)}
    by_hand = workload.group_by("participant", "step").agg(pl.col("value").cast(pl.Float64).mean())
    found = scores.filter(scale="nasa_tlx_raw").select("participant", "step", "score")
    assert found.sort("participant", "step").rows() == [
        (who, step, pytest.approx(mean)) for who, step, mean in by_hand.sort("participant", "step").iter_rows()
    ]
    assert found.height == 4 * 4
    trust = scores.filter(scale="trust_in_automation")
    assert trust.group_by("subscale").len()["len"].to_list() == [4] * 6
    page = (tmp_path / "report" / "report.html").read_text("utf-8")
    assert "Raw NASA-TLX" in page
    assert "Trust in Automation (TiA): Reliability/Competence" in page
    assert "Tlx effort" not in page, "items are not compared one by one"
