"""The report does not depend on the order in which the study file lists the conditions."""

from collections.abc import Sequence
from pathlib import Path

import pytest

from analysis.groups import main_contrast, pairs
from analysis.report import Report, write_report
from analysis.results import select
from analysis.study import Options
from analysis.synthetic import Truth, write_export
from tests.support.declaring import declaring
from tests.support.parameters import mostly_slow

LAYOUTS = ("matrix", "coordination_ring")


@pytest.mark.parametrize(
    "conditions",
    [("none", "tom"), ("tom", "none"), ("none", "random", "tom"), ("random", "tom", "none"), ("a", "none")],
)
def test_the_main_contrast_is_one_of_the_comparisons(conditions: Sequence[str]) -> None:
    assert main_contrast(conditions) in pairs(conditions)


def test_tom_is_compared_with_all_and_all_are_compared_with_none() -> None:
    published = [("tom", "none"), ("tom", "random"), ("random", "none")]
    assert pairs(("none", "random", "tom")) == pairs(("tom", "none", "random")) == pairs(("random", "tom", "none"))
    assert pairs(("random", "tom", "none")) == published
    assert pairs(("tom", "random")) == [("tom", "random")]
    assert pairs(("none", "low", "high")) == [("low", "none"), ("high", "none"), ("high", "low")]
    assert main_contrast(("low", "high", "none")) == ("high", "none")


def listed_as(folder: Path, out: Path, conditions: Sequence[str]) -> Report:
    text = f"conditions: [{', '.join(f'{{name: {name}}}' for name in conditions)}]\n"
    text += "smallest_effect: {reward: 10, answers: 0.5, layouts: [matrix]}\n"
    made = write_report(declaring(folder, out / "data", text), out / "report", Options(power_studies=20, draws=100))
    assert made.analysis.conditions == tuple(conditions)
    return made


@pytest.mark.usefixtures("no_pictures")
@pytest.mark.parametrize(
    "orders", mostly_slow([["none random tom", "random tom none", "tom none random"], ["none tom", "tom none"]])
)
@pytest.mark.slow
def test_the_sentences_are_the_same_whatever_the_order_of_the_conditions(orders: Sequence[str], tmp_path: Path) -> None:
    truth = Truth(
        participants=10, conditions=tuple(orders[0].split()), layouts=LAYOUTS, timesteps=20, broken=0,
        reward_effect={"tom": 40.0}, answer_effect={"tom": 1.5},
    )  # fmt: skip
    write_export(truth, tmp_path / "plain")
    made = [listed_as(tmp_path / "plain", tmp_path / order.replace(" ", "-"), order.split()) for order in orders]
    assert {one.analysis.contrast for one in made} == {("tom", "none")}
    first = text_of(made[0])
    assert "With ToM predictions teams earn more in 2 of 2 layouts with SP" in first
    for part in ("ToM predictions raised the reward", "points higher with ToM predictions than with no prediction"):
        assert part in first
    assert "the conclusion of the mixed model holds in all of them" in first
    for other in made[1:]:
        assert text_of(other) == first
        tests = {(row.section, row.test, row.contrast) for row in other.analysis.rows if row.contrast}
        assert tests == {(row.section, row.test, row.contrast) for row in made[0].analysis.rows if row.contrast}
        assert "ToM against None: two-sided t-tests" in other.page.read_text("utf-8")
        assert len(select(other.analysis.rows, section="reward", test="t_test_people", contrast="tom - none")) == 4


def text_of(report: Report) -> str:
    """Return the headlines and the sentences, without the one that lists the participants of each condition."""
    page = report.page.read_text("utf-8")
    findings = page.partition('<ol class="find">')[2].partition("</ol>")[0]
    sentences = page.partition("Sentences to paste</h2>")[2].partition("<h2>")[0]
    return "\n".join(line for line in (findings + sentences).split("<") if "Of those assigned" not in line)
