"""Levels that people met in blocks, as effects of the models that check the main one."""

import numpy as np
import polars as pl
import pytest
from statsmodels.formula.api import mixedlm, ols
from statsmodels.miscmodels.ordinal_model import OrderedModel

from analysis import model_checks, ordinal, questionnaires
from analysis.results import select
from tests.support.simulation import AGENTS, LAYOUTS


@pytest.fixture(scope="module")
def blocks() -> pl.DataFrame:
    """Marks in one half of the rounds help much. Rounds are missing at random, so that the two orders of the blocks
    have unequal shares of rounds with marks."""
    generator = np.random.default_rng(8)
    rows = [
        {
            "episode": f"{person}-{number}",
            "participant": f"p{person:02d}",
            "condition": f"order_{1 + person % 2}",
            "layout": LAYOUTS[number % 2],
            "agent": AGENTS[number // 2 % 2],
            "number": number + 1,
            "factor_prediction": "tom" if (number < 8) == (person % 2 == 1) else "none",
            "reward": 60.0 + 40.0 * ((number < 8) == (person % 2 == 1)) + 6 * talent + generator.normal(0, 5),
        }
        for person, talent in enumerate(generator.normal(size=20))
        for number in range(16)
        if generator.random() > (0.4 if (number < 8) == (person % 2 == 1) else 0.05)
    ]
    return pl.DataFrame(rows)


def test_checks_know_the_levels_that_people_met_in_blocks(blocks: pl.DataFrame) -> None:
    found = {row.test: row for row in model_checks.model_rows(blocks, ("order_1", "order_2")) if row.contrast}
    data = blocks.to_pandas()
    formula = "reward ~ C(condition) * C(factor_prediction, Sum) + C(agent, Treatment('sp')) + C(layout)"
    plain = ols(formula, data).fit()
    assert found["cluster_robust"].estimate == pytest.approx(plain.params["C(condition)[T.order_2]"])
    mixed = mixedlm(f"{formula} + number", data, groups=data["participant"]).fit(reml=True)
    assert found["with_round"].estimate == pytest.approx(mixed.params["C(condition)[T.order_2]"], rel=1e-3)
    assert found["with_round"].se == pytest.approx(mixed.bse["C(condition)[T.order_2]"], rel=1e-3)
    (slope,) = select(model_checks.model_rows(blocks, ("order_1", "order_2")), test="round")
    assert abs(slope.estimate) < 3 * slope.se
    assert slope.se < 0.5, "the levels are not noise"


def test_ordered_answers_know_the_levels_that_people_met_in_blocks(blocks: pl.DataFrame) -> None:
    """The answers do not vary between people, so that a model without people has the same estimates."""
    generator = np.random.default_rng(9)
    high = (blocks["factor_prediction"] == "tom").to_numpy()
    value = np.clip(np.round(2.5 + 1.5 * high + generator.normal(0, 1.1, blocks.height)), 1, 7)
    answers = blocks.select("episode", "participant", pl.Series("value", value), question=pl.lit("efficiency"))
    about = questionnaires.answers_on(answers, blocks, LAYOUTS)
    rows = ordinal.ordinal_rows(about, ("order_1", "order_2"))
    (spread,) = select(rows, test="person_sd")
    assert spread.estimate < 1e-3
    (odds,) = select(rows, test="odds")
    names = "C(condition) * C(factor_prediction, Sum) + C(agent) + C(layout)"
    plain = OrderedModel.from_formula(f"value ~ {names}", blocks.to_pandas().assign(value=value), distr="logit")
    fitted = plain.fit(method="bfgs", disp=False)
    assert odds.estimate == pytest.approx(fitted.params["C(condition)[T.order_2]"], abs=1e-3)
    assert odds.se == pytest.approx(fitted.bse["C(condition)[T.order_2]"], rel=1e-2)
