"""Factors within people: the numbers of statsmodels, power, and what the report says."""

import math
from itertools import product
from pathlib import Path

import numpy as np
import pandas as pd
import polars as pl
import pytest
from statsmodels.formula.api import mixedlm, ols

import kitchenmind
from analysis import factorial_power, factorial_within, measures, mixed_model, primary
from analysis.declared import DeclaredTest
from analysis.factorial_within import RepeatedCells
from analysis.power import PowerDesign
from analysis.report import write_report
from analysis.results import Result, select
from analysis.study import Options
from analysis.study_plan import plan_of_export
from analysis.synthetic import Truth, write_export
from analysis.tables import read_export
from tests.support.declaring import declaring

TWO = {"prediction": ("none", "tom"), "opacity": ("off", "on")}
STUDY = """factors:
  prediction: [none, tom]
cells: {within: [prediction]}
primary: {effect: [prediction]}
smallest_effect: {reward: 5, answers: 0.5}
"""


def drawn(
    factors: dict[str, tuple[str, ...]], within: tuple[str, ...], orders: int, people: list[int]
) -> RepeatedCells:
    """Correlated means of people with effects of everything, and of the order."""
    generator = np.random.default_rng(6)
    outer = list(product(*(levels for name, levels in factors.items() if name not in within)))
    count = math.prod(len(factors[name]) for name in within)
    sizes = iter(people * len(outer))
    groups = tuple(
        (
            levels,
            generator.normal(60, 9, (size := next(sizes), 1))
            + generator.normal(generator.normal(0, 4, count), 5, (size, count)),
        )
        for levels in outer
        for _ in range(orders)
    )
    return RepeatedCells(factors, within, groups)


def scores(cells: RepeatedCells, weights: list[float]) -> pd.DataFrame:
    rows = [
        {"value": float(value), "order": number % 2, "opacity": levels[0] if levels else ""}
        for number, (levels, values) in enumerate(cells.groups)
        for value in values @ np.array(weights)
    ]
    return pd.DataFrame(rows)


def test_effects_of_two_levels_are_the_regressions_of_statsmodels() -> None:
    """Of each person's difference, or mean, on the factor between people and the order."""
    cells = drawn(TWO, ("prediction",), 2, [5, 7, 4, 6])
    rows = factorial_within.of_repeated(cells, "")
    for weights, intercept, other in (
        ([-1.0, 1.0], "prediction", "prediction x opacity"),
        ([0.5, 0.5], "", "opacity"),
    ):
        model = ols("value ~ C(opacity, Sum) * C(order, Sum)", scores(cells, weights)).fit()
        for place, term, weight in ((0, intercept, 1), (1, other, -2)):
            if not term:
                continue
            test = model.t_test(np.eye(4)[place] * weight)
            (row,) = select(rows, test="difference", contrast=term)
            assert row.estimate == pytest.approx(float(test.effect[0]))
            assert (row.estimate_low, row.estimate_high) == pytest.approx(tuple(test.conf_int()[0]))
            (tested,) = select(rows, test="anova", contrast=term)
            assert (tested.p, tested.df_residual) == pytest.approx((float(test.pvalue), model.df_resid))
            assert tested.statistic == pytest.approx(float(test.tvalue[0, 0]) ** 2)
    level = ols("value ~ C(opacity, Sum) * C(order, Sum)", scores(cells, [0.0, 1.0])).fit()
    (mean,) = select(rows, test="marginal_mean", condition="tom")
    assert (mean.estimate_low, mean.estimate_high) == pytest.approx(tuple(level.conf_int().loc["Intercept"]))


def test_more_than_two_levels_are_the_mixed_model_of_statsmodels_with_box_s_correction() -> None:
    cells = drawn({"prediction": ("none", "random", "tom")}, ("prediction",), 2, [8, 8])
    (row,) = select(factorial_within.of_repeated(cells, ""), test="anova")
    data = pd.DataFrame(
        {"value": float(value), "order": order, "person": f"{order}-{person}", "level": level}
        for order, (_, values) in enumerate(cells.groups)
        for person, means in enumerate(values)
        for level, value in enumerate(means)
    )
    model = mixedlm("value ~ C(level, Sum) * C(order, Sum)", data, groups=data["person"]).fit(reml=True)
    names = [name for name in model.fe_params.index if name.startswith("C(level") and ":" not in name]
    wald = model.wald_test(
        np.eye(len(model.params))[[list(model.params.index).index(name) for name in names]], scalar=True
    )
    assert row.statistic == pytest.approx(float(wald.statistic) / 2, rel=1e-4)
    s = sum((len(values) - 1) * np.cov(values.T) for _, values in cells.groups)
    k, mean = 3, s.mean()
    above = k**2 * (np.diag(s).mean() - mean) ** 2
    below = (k - 1) * ((s**2).sum() - 2 * k * (s.mean(axis=1) ** 2).sum() + k**2 * mean**2)
    assert row.df == pytest.approx(2 * above / below)
    assert row.df_residual == pytest.approx(2 * 14 * above / below)
    pairs = [one for one in factorial_within.of_repeated(cells, "") if one.test == "simple_effect"]
    assert [one.contrast for one in pairs] == [
        "prediction: random - none",
        "prediction: tom - none",
        "prediction: tom - random",
    ]


@pytest.mark.parametrize("term", [("prediction",), ("opacity",), ("prediction", "opacity")])
def test_power_is_the_share_of_reports_that_find_the_effect(term: tuple[str, ...]) -> None:
    design, levels = PowerDesign(person_sd=8, residual_sd=12, episodes=8), {"prediction": 2, "opacity": 2}
    power = factorial_power.EffectPower(design, levels, term, within=("prediction",))
    effect = {("prediction",): 4.5, ("opacity",): 8.0}.get(term, 9.0)
    people, studies = 7, 400
    shape = factorial_power.smallest_pattern(levels, term) * effect
    generator, found = np.random.default_rng(2), 0
    for _ in range(studies):
        groups = tuple(
            (
                (TWO["opacity"][place // 2],),
                generator.normal(0, 8, (people, 1)) + generator.normal(shape[:, place // 2], 6, (people, 2)),
            )
            for place in range(4)
        )
        cells = RepeatedCells(TWO, ("prediction",), groups)
        found += factorial_within.tested(Result("", ""), cells, term).p < 0.05
    exact = power.exact(effect, people)
    assert power.conditions == 4
    assert 0.2 < exact < 0.97
    assert abs(found / studies - exact) < 4 * math.sqrt(exact * (1 - exact) / studies)


def test_results_that_cannot_be_computed_give_a_reason() -> None:
    empty = RepeatedCells(TWO, ("prediction",), ((("off",), np.array([[1.0, 2.0]])),))
    (row,) = factorial_within.of_repeated(empty, "")
    assert row.note == "nobody has values in all blocks with opacity on"
    alone = RepeatedCells({"prediction": ("none", "tom")}, ("prediction",), (((), np.array([[1.0, 2.0]])),))
    assert factorial_within.of_repeated(alone, "")[0].note == "every order of the blocks has one person"


@pytest.fixture(scope="module")
def blocks(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """An export in which each person met no marks in one half of the rounds and marks, which help, in the other."""
    folder = tmp_path_factory.mktemp("blocks")
    write_export(Truth(participants=8, conditions=("order_1", "order_2"), timesteps=20, seed=3), folder / "plain")
    out = declaring(folder / "plain", folder / "out", STUDY)
    path = out / "episodes.parquet"
    table = pl.read_parquet(path)
    first = pl.col("number") <= table["number"].max() / 2  # type: ignore[operator]
    second = pl.col("condition").cast(pl.String) == "order_2"
    level = pl.when(first == second).then(pl.lit("tom")).otherwise(pl.lit("none"))
    table = table.with_columns(factor_prediction=level, block=pl.when(first).then(1).otherwise(2))
    table.with_columns(
        score=pl.col("score") + 25 * (pl.col("factor_prediction") == "tom").cast(pl.Int32)
    ).write_parquet(path)
    return out


def test_the_power_of_a_pilot_in_blocks_uses_the_variance_of_the_test_within_people(blocks: Path) -> None:
    """The effects of the levels and the blocks are large and are not variance."""
    export = read_export(blocks)
    plan = plan_of_export(export)
    episodes = measures.analysed(measures.episode_measures(export), export.participants).to_pandas()
    keys = ["reward", "participant", "condition", "factor_prediction", "layout", "agent"]
    table = episodes[keys].astype({"condition": str})
    formula = "reward ~ C(condition) * C(factor_prediction) + C(layout) + C(agent)"
    wanted = mixedlm(formula, table, groups=table["participant"]).fit(reml=True)
    assert plan.residual_sd == pytest.approx(math.sqrt(wanted.scale), rel=1e-3)
    assert plan.person_sd == pytest.approx(math.sqrt(float(wanted.cov_re.iloc[0, 0])), rel=1e-2)
    without = mixed_model.fit(pl.from_pandas(table), "reward", export.conditions)
    assert without.variance is not None
    assert without.variance.residual_sd == pytest.approx(plan.residual_sd)
    plain = mixed_model.fit(pl.from_pandas(table.drop(columns="factor_prediction")), "reward", export.conditions)
    assert plain.variance is not None
    assert plain.variance.residual_sd > 1.2 * wanted.scale**0.5
    pairs = (select(model.rows, test="fixed_effect")[0].estimate for model in (plain, without))
    assert next(pairs) == pytest.approx(next(pairs), abs=0.5), "a difference between conditions is that of their means"


def test_with_one_value_in_each_block_the_residual_is_that_of_the_differences() -> None:
    generator = np.random.default_rng(4)
    rows = [
        (f"{order}{person}", order, level, 60 + talent + shift + 7 * (number == 1) + generator.normal(0, 5))
        for order, levels in (("a", ("none", "tom")), ("b", ("tom", "none")))
        for person in range(9)
        for talent in (generator.normal(0, 8),)
        for number, level in enumerate(levels)
        for shift in ({"none": 0, "tom": 30}[level],)
    ]
    names = ["participant", "condition", "factor_prediction", "reward"]
    table = pl.DataFrame(rows, schema=names, orient="row").with_columns(layout=pl.lit("matrix"), agent=pl.lit("sp"))
    variance = mixed_model.fit(table, "reward", ("a", "b")).variance
    wide = table.pivot(on="factor_prediction", index=["participant", "condition"], values="reward")
    wide = wide.with_columns(difference=pl.col("tom") - pl.col("none"))
    pooled = float(np.mean([part["difference"].var() for _, part in wide.group_by("condition")]))  # type: ignore[arg-type]
    assert variance is not None
    assert variance.residual_sd == pytest.approx(math.sqrt(pooled / 2), rel=1e-4)


def test_orders_in_which_a_combination_is_missing_can_still_be_fitted() -> None:
    table = pl.DataFrame(
        {
            "participant": [f"{order}{person}" for order in "ab" for person in range(4) for _ in range(4)],
            "condition": [order for order in "ab" for _ in range(16)],
            "factor_prediction": ["none", "tom", "none", "tom"] * 4 + ["none", "tom", "random", "tom"] * 4,
            "reward": np.random.default_rng(1).normal(60, 9, 32),
            "layout": "matrix",
            "agent": "sp",
        }
    )
    assert mixed_model.fit(table, "reward", ("a", "b")).variance is not None


@pytest.mark.usefixtures("no_pictures")
def test_the_report_analyses_differences_within_people(
    blocks: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    made = write_report(blocks, tmp_path / "report", Options(power_studies=20, draws=50))
    (row,) = select(made.analysis.rows, section="primary")
    episodes = made.analysis.episodes
    means = episodes.group_by("participant", "condition", "factor_prediction").agg(pl.col("reward").mean())
    wide = means.pivot(on="factor_prediction", index=["participant", "condition"], values="reward").to_pandas()
    wide["difference"] = wide["tom"] - wide["none"]
    model = ols("difference ~ C(condition, Sum)", wide.astype({"condition": str})).fit()
    assert row.estimate == pytest.approx(model.params["Intercept"])
    assert row.p == pytest.approx(model.pvalues["Intercept"])
    assert (row.n, row.estimate_low < 25 < row.estimate_high) == (16, True)
    page = made.page.read_text("utf-8")
    assert "Simulated participants met the levels of prediction in blocks of rounds" in page
    assert "(prediction within simulated participants, with the orders of the blocks averaged), there was" in page
    assert "there was a main effect of prediction on the reward; the difference is (tom - none)" in page
    assert "The conditions are the orders of the blocks" in page
    assert select(made.analysis.rows, section="equivalence") == [], "nobody asks whether two orders are equivalent"
    assert "equivalence is not tested" in page
    assert "sets no smallest effect of interest" not in page
    words = ["power", str(blocks), "--effect", "10", "--studies", "20", "--out", str(tmp_path / "power")]
    assert kitchenmind.main(words) == 0
    out = capsys.readouterr().out
    assert (
        "main effect of prediction: with 8 participants in each of 2 conditions, a true difference of 10 points" in out
    )
    assert "F test over differences within participants" in out
    assert "No curve: prediction varies within participants." in out


def test_a_declared_effect_within_people_has_a_direction() -> None:
    cells = drawn({"prediction": ("none", "tom")}, ("prediction",), 2, [9, 9])
    both = primary.of_effect(DeclaredTest("reward", (), "anova", effect=("prediction",)), cells)
    greater = primary.of_effect(DeclaredTest("reward", (), "anova", "greater", effect=("prediction",)), cells)
    less = primary.of_effect(DeclaredTest("reward", (), "anova", "less", effect=("prediction",)), cells)
    assert greater.p + less.p == pytest.approx(1)
    assert min(greater.p, less.p) == pytest.approx(both.p / 2)
