"""Factorial designs: the numbers of statsmodels, what the report says, and the power of effects."""

import csv
import math
import shutil
from collections.abc import Sequence
from itertools import product
from pathlib import Path

import numpy as np
import pandas as pd
import polars as pl
import pytest
from statsmodels.formula.api import ols
from statsmodels.stats.anova import anova_lm

import kitchenmind
from analysis import compare, factorial, factorial_power
from analysis.factorial import FactorialCells
from analysis.power import PowerDesign
from analysis.report import write_report
from analysis.results import Result, select
from analysis.study import Options, analyse
from analysis.synthetic import Truth, write_export
from analysis.tables import read_export
from tests.support.declaring import declaring

TWO = {"prediction": ("none", "tom"), "opacity": ("off", "on")}
WIDE = {"prediction": ("none", "random", "tom"), "opacity": ("off", "on"), "steps": ("one", "three")}


def drawn(factors: dict[str, tuple[str, ...]], seed: int) -> FactorialCells:
    """Cells of different sizes with effects of everything."""
    generator = np.random.default_rng(seed)
    count = math.prod(map(len, factors.values()))
    return FactorialCells(
        factors,
        tuple(generator.normal(generator.normal(60, 6), 8, int(generator.integers(3, 11))) for _ in range(count)),
    )


def as_table(cells: FactorialCells) -> pd.DataFrame:
    return pd.DataFrame(
        [{**name, "value": value} for name, values in zip(cells.names, cells.values, strict=True) for value in values]
    )


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("factors", [TWO, WIDE], ids=["2x2", "3x2x2"])
def test_effects_are_those_of_statsmodels_with_sum_coding(factors: dict[str, tuple[str, ...]], seed: int) -> None:
    cells = drawn(factors, seed)
    model = ols("value ~ " + " * ".join(f"C({name}, Sum)" for name in factors), as_table(cells)).fit()
    other = anova_lm(model, typ=3)
    rows = [row for row in factorial.of_measure(cells, "") if row.test == "anova"]
    assert len(rows) == 2 ** len(factors) - 1
    for row in rows:
        line = other.loc[":".join(f"C({name}, Sum)" for name in row.contrast.split(" x "))]
        assert row.statistic == pytest.approx(line["F"])
        assert row.p == pytest.approx(line["PR(>F)"])
        assert (row.df, row.df_residual) == (line["df"], model.df_resid)
        eta = line["sum_sq"] / (line["sum_sq"] + other.loc["Residual", "sum_sq"])
        assert row.effect == pytest.approx(eta)
        assert row.ci_low <= row.effect <= row.ci_high
        assert (row.ci_low > 0) == (row.p < 0.05)


@pytest.mark.parametrize("seed", range(3))
def test_differences_and_marginal_means_are_those_of_statsmodels(seed: int) -> None:
    cells = drawn(TWO, seed)
    model = ols("value ~ C(prediction, Sum) * C(opacity, Sum)", as_table(cells)).fit()
    rows = factorial.of_measure(cells, "")
    # Sum coding: the first level counts 1, the last -1, so that a difference is -2 and an interaction 4 coefficients.
    for term, weight, place in (("prediction", -2, 1), ("opacity", -2, 2), ("prediction x opacity", 4, 3)):
        other = model.t_test(np.eye(4)[place] * weight)
        (row,) = select(rows, test="difference", contrast=term)
        assert row.estimate == pytest.approx(float(other.effect[0]))
        assert (row.estimate_low, row.estimate_high) == pytest.approx(tuple(other.conf_int()[0]))
        assert row.p == pytest.approx(float(other.pvalue))
    for level, sign in (("none", 1), ("tom", -1)):
        other = model.t_test(np.array([1, sign, 0, 0]))
        (row,) = select(rows, test="marginal_mean", condition=level)
        assert row.estimate == pytest.approx(float(other.effect[0]))
        assert (row.estimate_low, row.estimate_high) == pytest.approx(tuple(other.conf_int()[0]))


def test_simple_effects_are_the_t_tests_at_each_level_of_the_other_factor() -> None:
    cells = drawn(TWO, 5)
    rows = [row for row in factorial.of_measure(cells, "") if row.test == "simple_effect"]
    assert [(row.contrast, row.condition) for row in rows] == [
        ("prediction: tom - none", "opacity off"),
        ("prediction: tom - none", "opacity on"),
        ("opacity: on - off", "prediction none"),
        ("opacity: on - off", "prediction tom"),
    ]
    none_on, tom_on = cells.values[1], cells.values[3]
    expected = compare.t_test(Result("", ""), tom_on, none_on)
    assert (rows[1].p, rows[1].effect, rows[1].ci_low) == (expected.p, expected.effect, expected.ci_low)
    pair = sorted((rows[0].p, rows[1].p))
    assert max(rows[0].p_adjusted, rows[1].p_adjusted) == pytest.approx(pair[1])
    assert min(rows[0].p_adjusted, rows[1].p_adjusted) == pytest.approx(min(2 * pair[0], pair[1]))


CONDITIONS = tuple("_".join(levels) for levels in product(*TWO.values()))
STUDY = """factors:
  prediction: [none, tom]
  opacity: {"off": {}, "on": {confidence_opacity: true}}
"""


@pytest.fixture(scope="module")
def crossed(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """An export in which fading marks help with predictions only: an interaction."""
    folder = tmp_path_factory.mktemp("crossed")
    truth = Truth(participants=14, conditions=CONDITIONS, reward_effect={"tom_on": 30.0}, timesteps=20, seed=3)
    write_export(truth, folder / "plain")
    out = declaring(folder / "plain", folder / "out", STUDY)
    path = out / "participants.parquet"
    parts = pl.col("condition").str.split("_").list
    people = pl.read_parquet(path).reverse()
    people.with_columns(factor_prediction=parts.get(0), factor_opacity=parts.get(1)).write_parquet(path)
    return out


def test_a_report_has_main_effects_interaction_and_simple_effects(
    crossed: Path, tmp_path: Path, no_pictures: None
) -> None:
    report = write_report(crossed, tmp_path, Options(power_studies=20, draws=50))
    assert report.analysis.conditions == CONDITIONS
    rows = select(report.analysis.rows, section="factorial", question="")
    interaction = next(row for row in rows if row.test == "difference" and row.contrast == "prediction x opacity")
    assert interaction.estimate_low < 30 < interaction.estimate_high
    assert interaction.p < 0.01
    assert interaction.note == "(tom - none) x (on - off)"
    page = report.page.read_text("utf-8")
    assert "<h3>Factors</h3>" in page
    assert "<td>Prediction × opacity</td>" in page
    assert "an interaction of prediction and opacity (<i>F</i>(1, 52) = " in page
    assert "As factors interacted in reward, simple effects over simulated participants: prediction, tom" in page
    questions = [row for row in select(report.analysis.rows, section="factorial", test="anova") if row.question]
    assert {row.note for row in questions} == {"Benjamini-Hochberg over 4 tests"}
    with report.results.open(encoding="utf-8", newline="") as stream:
        kept = [line for line in csv.DictReader(stream) if line["section"] == "factorial"]
    assert len(kept) == len(select(report.analysis.rows, section="factorial"))


def test_a_missing_combination_is_named_and_the_rest_is_reported(crossed: Path, tmp_path: Path) -> None:
    shutil.copytree(crossed, tmp_path / "out")
    path = tmp_path / "out" / "participants.parquet"
    pl.read_parquet(path).filter(pl.col("condition") != "none_on").write_parquet(path)
    analysis = analyse(read_export(tmp_path / "out"), Options(power_studies=20, draws=50))
    (row,) = select(analysis.rows, section="factorial", question="")
    assert row.note == "nobody has values with prediction none, opacity on"


def test_a_study_without_factors_has_no_such_section(planted_folder: Path) -> None:
    assert factorial.factors_of(read_export(planted_folder)) == {}


@pytest.mark.parametrize(
    ("values", "words"),
    [
        (([1.0, 2.0], [], [2.0, 3.0], [1.0, 4.0]), "nobody has values with prediction none, opacity on"),
        (([1.0], [2.0], [3.0], [4.0]), "every combination of levels has one person"),
        (([1.0, 1.0], [2.0, 2.0], [3.0, 3.0], [4.0, 4.0]), "the values do not vary within the combinations"),
    ],
)
def test_results_that_cannot_be_computed_give_a_reason(values: Sequence[Sequence[float]], words: str) -> None:
    rows = factorial.of_measure(FactorialCells(TWO, tuple(np.array(part, dtype=np.float64) for part in values)), "")
    tests = [row for row in rows if row.test == "anova"]
    assert tests
    assert all(words in row.note and math.isnan(row.p) for row in tests)


DESIGN = PowerDesign(person_sd=8, residual_sd=12, episodes=4)


@pytest.mark.parametrize(
    ("levels", "term"),
    [
        ({"a": 3, "b": 2}, ("a", "b")),
        ({"a": 2, "b": 2}, ("a",)),
        ({"a": 2, "b": 2}, ("a", "b")),
        ({"a": 3, "b": 2}, ("a",)),
        ({"a": 2, "b": 2, "c": 2}, ("a", "b", "c")),
    ],
)
@pytest.mark.slow
def test_power_is_the_share_of_reports_that_find_the_effect(levels: dict[str, int], term: tuple[str, ...]) -> None:
    people, effect, studies = 6, 12.0 if len(term) == 1 else 28.0, 400
    names = {name: tuple(f"{name}{level}" for level in range(count)) for name, count in levels.items()}
    generator = np.random.default_rng(4)
    shape = factorial_power.smallest_pattern(levels, term) * effect
    found = 0
    for _ in range(studies):
        values = tuple(generator.normal(mean, DESIGN.mean_sd, people) for mean in shape.ravel())
        rows = factorial.of_measure(FactorialCells(names, values), "")
        found += next(row for row in rows if row.test == "anova" and row.contrast == " x ".join(term)).p < DESIGN.alpha
    exact = factorial_power.EffectPower(DESIGN, levels, term).exact(effect, people)
    assert 0.1 < exact < 0.95
    assert abs(found / studies - exact) < 4 * math.sqrt(exact * (1 - exact) / studies)


@pytest.mark.parametrize("levels", [{"a": 2, "b": 2}, {"a": 3, "b": 2}, {"a": 4, "b": 3}])
def test_the_pattern_of_an_effect_has_it_and_nothing_else(levels: dict[str, int]) -> None:
    for term in (("a",), ("b",), ("a", "b")):
        shape = factorial_power.smallest_pattern(levels, term)
        names = {name: [str(level) for level in range(count)] for name, count in levels.items()}
        for other in factorial.terms(names):
            found = factorial.contrast_weights(names, other) @ shape.ravel()
            assert np.abs(found).max() == pytest.approx(1 if other == term else 0)


def test_the_power_command_covers_the_factors_of_a_study(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], no_pictures: None
) -> None:
    example = Path(__file__).parents[2] / "studies" / "examples" / "two_factors.yaml"
    spread = ["--person-sd", "8", "--residual-sd", "14", "--studies", "20", "--participants", "20"]
    words = ["power", str(example), "--effect", "10", *spread, "--out", str(tmp_path)]
    assert kitchenmind.main(words) == 0
    lines = [line for line in capsys.readouterr().out.splitlines() if line.startswith("Factorial")]
    assert [line.split(":")[0] for line in lines] == [
        "Factorial analysis of variance, main effect of steps",
        "Factorial analysis of variance, main effect of opacity",
        "Factorial analysis of variance, interaction of steps and opacity",
    ]
    assert "a true difference of 10 points is found with a probability of" in lines[0]
    assert "a true difference of differences of 10 points" in lines[2]
    study = tmp_path / "left_out.yaml"
    study.write_text(example.read_text("utf-8") + "cells: {without: [one_on]}\n", encoding="utf-8")
    assert kitchenmind.main([*words[:1], str(study), *words[2:]]) == 0
    assert "Factorial: no power of its effects, as the study leaves out one_on." in capsys.readouterr().out


def test_the_power_of_an_export_is_not_that_of_combinations_that_its_study_leaves_out(
    crossed: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str], no_pictures: None
) -> None:
    """As of the study file alone: without a combination, the report computes no effects of the factors."""
    shutil.copytree(crossed, tmp_path / "data")
    (path,) = (tmp_path / "data" / "studies").iterdir()
    path.write_text(path.read_text("utf-8") + "cells: {without: [none_on]}\n", encoding="utf-8")
    words = ["power", str(tmp_path / "data"), "--effect", "10", "--studies", "20", "--out", str(tmp_path / "power")]
    assert kitchenmind.main(words) == 0
    lines = [line for line in capsys.readouterr().out.splitlines() if line.startswith("Factorial")]
    assert lines == ["Factorial: no power of its effects, as the study leaves out none_on."]


def test_the_power_command_reads_the_factors_of_a_pilot(
    crossed: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str], no_pictures: None
) -> None:
    words = ["power", str(crossed), "--effect", "10", "--studies", "20", "--out", str(tmp_path)]
    assert kitchenmind.main(words) == 0
    assert (
        "interaction of prediction and opacity: with 14 participants in each of 4 conditions" in capsys.readouterr().out
    )
