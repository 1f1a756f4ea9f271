"""Scores and reliability of published scales, against values computed by hand."""

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import polars as pl
import pytest

from analysis import scales
from analysis.study import Options, analyse
from analysis.tables import Export

STUDY = """
name: {name}
questionnaires:
  after: {{questions: [{{type: published, scale: nasa_tlx_raw}}]}}
  end: {{questions: [{{key: own, type: scale}}, {{type: published, scale: trust_in_automation, subscales: [trust]}}]}}
"""
USED = {"after": ("nasa_tlx_raw",), "end": ("trust_in_automation",)}
TLX = ("mental_demand", "physical_demand", "temporal_demand", "performance", "effort", "frustration")
PEOPLE = {"p1": "tom", "p2": "tom", "p3": "none", "p4": "none"}


def answers(step: str, person: str, values: dict[str, float], episode: str | None = None) -> pl.DataFrame:
    rows = [(person, episode, step, question, value) for question, value in values.items()]
    schema = {"participant": pl.String, "episode": pl.String, "step": pl.String, "question": pl.String, "value": float}
    return pl.DataFrame(rows, schema, orient="row")


def export_with(planted: Export, *pages: pl.DataFrame) -> Export:
    return replace(planted, all_answers=pl.concat(pages))


@pytest.fixture
def episodes() -> pl.DataFrame:
    return pl.DataFrame(
        {"participant": list(PEOPLE), "condition": list(PEOPLE.values()), "episode": [f"e{n}" for n in range(4)]}
    )


def test_a_score_is_the_mean_of_the_items_of_one_page(planted: Export, episodes: pl.DataFrame) -> None:
    values = dict(zip((f"tlx_{name}" for name in TLX), (0, 10, 20, 30, 40, 100), strict=True))
    page = answers("after-01", "p1", values, "e0")
    elsewhere = answers("after-02", "p1", values, "an episode that does not count")
    found = scales.scores(export_with(planted, page, elsewhere), episodes, USED)
    (row,) = found.to_dicts()
    assert (row["score"], row["answered"], row["items"]) == (pytest.approx(200 / 6), 6, 6)
    assert (row["participant"], row["condition"], row["step"], row["subscale"]) == ("p1", "tom", "after-01", "workload")


def test_answers_about_a_round_that_was_deleted_with_the_partner_are_not_about_the_study(
    planted: Export, episodes: pl.DataFrame
) -> None:
    """They stay with the person who did not withdraw, and no longer name an episode."""
    values = {f"tlx_{name}": 50.0 for name in TLX}
    pages = (answers("after-01", "p1", values), answers("after", "p2", values))
    found = scales.scores(export_with(planted, *pages), episodes, USED)
    assert found["step"].to_list() == ["after"], "the same questionnaire, once in the study"


def test_a_reversed_item_is_turned_round(planted: Export, episodes: pl.DataFrame) -> None:
    one = answers("end", "p1", {"tia_pro1": 5, "tia_pro2": 5, "tia_pro3": 5})
    (row,) = scales.scores(export_with(planted, one), episodes, USED).to_dicts()
    assert (row["subscale"], row["score"]) == ("propensity_to_trust", pytest.approx((1 + 5 + 5) / 3))


@pytest.mark.parametrize(("answered", "scored"), [(3, 1), (2, 0)])
def test_half_of_the_items_is_enough(planted: Export, episodes: pl.DataFrame, answered: int, scored: int) -> None:
    page = answers("after-01", "p1", {f"tlx_{name}": 50 for name in TLX[:answered]}, "e0")
    assert scales.scores(export_with(planted, page), episodes, USED).height == scored


def test_cronbachs_alpha_by_hand() -> None:
    assert scales.reliability(np.array([[1, 2, 2], [2, 2, 3], [3, 4, 4], [5, 4, 5]], float)) == pytest.approx(
        3 / 2 * (1 - (2.9166666667 + 1.3333333333 + 1.6666666667) / 16.25)
    )
    assert scales.reliability(np.array([[1, 1], [2, 3], [3, 2]], float)) == pytest.approx(2 * 0.5 / 1.5)
    assert math.isnan(scales.reliability(np.full((4, 3), 2.0)))


def test_rows_have_means_of_people_and_the_reliability(planted: Export, episodes: pl.DataFrame) -> None:
    given = {"p1": (4, 5), "p2": (3, 3), "p3": (1, 2), "p4": (2, 2)}
    export = export_with(planted, *(answers("end", name, {"tia_t1": a, "tia_t2": b}) for name, (a, b) in given.items()))
    rows = scales.rows(export, scales.scores(export, episodes, USED), USED, ["none", "tom"])
    assert {row.question for row in rows} == {"end/trust_in_automation/trust"}
    means = {row.condition: (row.estimate, row.n) for row in rows if row.test == "mean"}
    assert means == {"none": (pytest.approx(1.75), 2), "tom": (pytest.approx(3.75), 2)}
    (alike,) = [row for row in rows if row.test == "spearman_brown"]
    r = np.corrcoef([4, 3, 1, 2], [5, 3, 2, 2])[0, 1]
    assert (alike.estimate, alike.n) == (pytest.approx(2 * r / (1 + r)), 4)
    (test,) = [row for row in rows if row.test == "t_test_people"]
    assert (test.contrast, test.estimate) == ("tom - none", pytest.approx(2.0))
    assert scales.scale_title(test.question) == "Trust in Automation (TiA): Trust in Automation"


def test_items_count_in_their_score_and_not_one_by_one(planted: Export, tmp_path: Path) -> None:
    (tmp_path / "studies").mkdir()
    (tmp_path / "studies" / f"{planted.study}_version-1.yaml").write_text(STUDY.format(name=planted.study), "utf-8")
    items = planted.answers.with_columns(question=pl.lit("tlx_effort"), step=pl.lit("after-01"))
    export = replace(planted, folder=tmp_path, answers=items, all_answers=items)
    assert scales.used_scales(export) == USED
    found = analyse(export, Options(draws=20, power_studies=2))
    assert not [row for row in found.rows if row.section == "questionnaire"]


def test_a_question_that_only_has_the_name_of_an_item_is_not_scored(planted: Export) -> None:
    assert scales.used_scales(planted) == {}
    assert scales.without_items(planted.answers, {}).height == planted.answers.height
