"""A failing manipulation is never silent: it is refused at the start, or counted when it fails in a game."""

import json
from pathlib import Path

import polars as pl
import pytest

from server.study.loader import StudyError
from tests.server.bots.test_bots import SCRIPTED
from tests.support.command_line import run
from tests.support.live_server import LiveServer

SOMETIMES = """
import numpy as np

class Sometimes:
    # well while it is tried, then it fails now and then

    def __init__(self, layout):
        self.calls = 0

    def begin(self, slots):
        pass

    def predict(self, slots, observations, last_actions):
        self.calls += 1
        if self.calls > 10 and self.calls % 4 == 0:
            raise RuntimeError("pretends to be broken")
        return np.full((len(slots), 3, 6), 1 / 6, np.float32)
"""

BREAKS = """
import numpy as np

class Breaks:
    # well while it is tried, then it fails always

    def __init__(self, layout):
        self.calls = 0

    def probabilities(self, observations):
        self.calls += 1
        if self.calls > 10:
            raise RuntimeError("pretends to be broken")
        return np.full((len(observations), 6), 1 / 6, np.float32)
"""


def study(folder: Path, predictor: str) -> Path:
    file = folder / "small.yaml"
    text = SCRIPTED.read_text("utf-8").replace("- {name: without, predictor: none}\n", "")
    file.write_text(text.replace("planner, predictor: random", f"planner, predictor: {predictor}"), encoding="utf-8")
    return file


@pytest.mark.timeout(1200)
@pytest.mark.parametrize("predictor", ["bc_predictor", "./missing.onnx", "'sometimes:Mistyped'"])
def test_a_study_whose_predictor_is_missing_is_not_served_and_bots_say_why(predictor: str, tmp_path: Path) -> None:
    (tmp_path / "sometimes.py").write_text(SOMETIMES, encoding="utf-8")
    file = study(tmp_path, predictor)
    with pytest.raises(StudyError, match=r"short.yaml:\d.*agents\.0\.predictor: "):  # `serve` ends with 2 then
        LiveServer(tmp_path, study=file.read_text("utf-8")).start()
    walked = run("bots", "1", "--study", str(file), "--fast")
    assert walked.returncode == 2
    assert f"{file}:" in walked.stderr
    assert "agents.0.predictor: " in walked.stderr


@pytest.mark.timeout(1200)
@pytest.mark.slow
def test_every_timestep_without_the_required_display_is_counted_by_bots_export_and_report(tmp_path: Path) -> None:
    (tmp_path / "sometimes.py").write_text(SOMETIMES, encoding="utf-8")
    database = f"sqlite:///{tmp_path / 'kept.sqlite3'}"
    words = ("--study", str(study(tmp_path, "'sometimes:Sometimes'")), "--database", database, "--fast", "--json")
    walked = run("bots", "1", *words)
    assert walked.returncode == 1, walked.stderr
    outcome = json.loads(walked.stdout)
    assert any("is not what its condition requires" in violation for violation in outcome["violations"])
    exported = run("export", "--database", database, "--out", str(tmp_path / "data"))
    assert exported.returncode == 0, exported.stderr
    episodes = pl.read_parquet(tmp_path / "data" / "parquet" / "episodes.parquet")
    ticks = pl.read_parquet(tmp_path / "data" / "parquet" / "ticks.parquet").filter(pl.col("displayed_1") == 6)
    empty = {row["episode"]: row["len"] for row in ticks.group_by("episode").len().to_dicts()}
    assert empty
    kept = {row["episode"]: row["display_violations"] for row in episodes.to_dicts() if row["display_violations"]}
    assert kept == empty
    late = {row["episode"]: row["display_violations_late"] for row in episodes.to_dicts()}
    assert all(late[episode] <= kept[episode] for episode in empty), "those in which the server was too slow"
    assert episodes.filter(pl.col("episode").is_in(list(empty)))["predictor_sha256"].null_count() == 0
    reported = run("report", str(tmp_path / "data"), "--out", str(tmp_path / "report"))
    assert reported.returncode == 0, reported.stderr
    page = (tmp_path / "report" / "report.html").read_text("utf-8")
    assert "The screen did not always show what the condition requires" in page
    quality = pl.read_csv(tmp_path / "report" / "quality.csv")
    flagged = quality.filter(pl.col("rules").fill_null("").str.contains("display"))
    assert set(flagged["episode"]) == {episode for episode in empty if episode in set(quality["episode"])}


@pytest.mark.timeout(1200)
@pytest.mark.slow
def test_timesteps_in_which_a_broken_agent_gave_no_answer_are_reported(tmp_path: Path) -> None:
    (tmp_path / "breaks.py").write_text(BREAKS, encoding="utf-8")
    file = study(tmp_path, "random")
    planner = "planner, predictor: random"
    file.write_text(file.read_text("utf-8").replace(planner, f"mine, model: 'breaks:Breaks', {planner[9:]}"), "utf-8")
    walked = run("bots", "1", "--study", str(file), "--fast", "--json")
    assert json.loads(walked.stdout)["late_timesteps"] > 10
