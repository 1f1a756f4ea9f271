"""The example study with two factors: walked by bots, in balanced cells, exported with its levels, and reported."""

import json
from collections import Counter
from pathlib import Path

import pytest

import kitchenmind
from tests.support.command_line import run

STUDY = Path(__file__).parents[3] / "studies" / "examples" / "two_factors.yaml"
CELLS = {
    "one_off": ("one", "off", 1, False),
    "one_on": ("one", "on", 1, True),
    "three_off": ("three", "off", 3, False),
    "three_on": ("three", "on", 3, True),
}


@pytest.mark.slow
@pytest.mark.timeout(1200)
def test_bots_meet_every_combination_and_the_report_has_the_effects(tmp_path: Path) -> None:
    database = f"sqlite:///{tmp_path / 'kept.sqlite3'}"
    short = tmp_path / "two_factors.yaml"
    text = STUDY.read_text("utf-8").replace("flow: [introduction, tutorial,", "flow: [introduction,")
    short.write_text(text + "game: {horizon: 40}\n", encoding="utf-8")
    walked = run("bots", "8", "--study", str(short), "--database", database, "--fast", "--json")
    assert walked.returncode == 0, walked.stdout + walked.stderr
    assert json.loads(walked.stdout)["violations"] == []
    exported = run("export", "--database", database, "--out", str(tmp_path / "data"))
    assert exported.returncode == 0, exported.stderr
    export = kitchenmind.load(tmp_path / "data")
    people = export.participants.select("condition", "factor_steps", "factor_opacity").rows()
    assert Counter(condition for condition, *_ in people) == dict.fromkeys(CELLS, 2)
    specs = export.episodes.select("condition", "spec").rows()
    for condition, steps, opacity in people:
        assert (steps, opacity) == CELLS[condition][:2]
    for condition, spec in specs:
        played = json.loads(spec)
        assert (played["steps_shown"], played["confidence_opacity"]) == CELLS[condition][2:]
    reported = run("report", str(tmp_path / "data"), "--out", str(tmp_path / "report"))
    assert reported.returncode == 0, reported.stderr
    page = (tmp_path / "report" / "report.html").read_text("utf-8")
    assert "<h3>Factors</h3>" in page
    assert "<td>Steps × opacity</td>" in page


@pytest.mark.slow
@pytest.mark.timeout(1200)
def test_bots_meet_the_levels_within_people_in_blocks_and_the_report_compares_within_people(tmp_path: Path) -> None:
    database = f"sqlite:///{tmp_path / 'kept.sqlite3'}"
    short = tmp_path / "two_factors.yaml"
    text = STUDY.read_text("utf-8").replace("flow: [introduction, tutorial,", "flow: [introduction,")
    text = text.replace('opacity: ["off", "on"]', "prediction: [none, tom]\ncells: {within: [prediction]}")
    short.write_text(text + "game: {horizon: 30}\nprimary: {effect: [prediction]}\n", encoding="utf-8")
    walked = run("bots", "8", "--study", str(short), "--database", database, "--fast", "--json")
    assert walked.returncode == 0, walked.stdout + walked.stderr
    assert json.loads(walked.stdout)["violations"] == []
    assert run("export", "--database", database, "--out", str(tmp_path / "data")).returncode == 0
    export = kitchenmind.load(tmp_path / "data")
    assert "factor_prediction" not in export.participants.columns
    arms = Counter(export.participants["condition"].to_list())
    assert arms == {f"{steps}_order_{number}": 2 for steps in ("one", "three") for number in (1, 2)}
    columns = ("condition", "number", "block", "factor_steps", "factor_prediction", "shown")
    for condition, number, block, steps, level, shown in export.episodes.select(columns).rows():
        assert (block, steps) == (number, condition.partition("_")[0])
        assert level == (("none", "tom") if condition.endswith("1") else ("tom", "none"))[number - 1]
        assert shown == {"none": "nothing", "tom": "predictor"}[level]
    asked = export.answers.join(export.episodes, on="episode").filter(question="predictor_satisfaction")
    assert set(asked["factor_prediction"]) == {"tom"}, "asked in the blocks with marks"
    assert run("report", str(tmp_path / "data"), "--out", str(tmp_path / "report")).returncode == 0
    assert "Simulated participants met the levels of prediction in blocks" in (
        tmp_path / "report" / "report.html"
    ).read_text("utf-8")
