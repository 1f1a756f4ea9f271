"""A primary test that is an effect of factors: the numbers of statsmodels, the first place in the report, and power."""

import csv
import math
import re
from pathlib import Path

import numpy as np
import pandas as pd
import polars as pl
import pytest
from statsmodels.formula.api import ols
from statsmodels.stats.anova import anova_lm

import kitchenmind
from analysis import factorial_power, primary
from analysis.declared import DIRECTIONS, Declaration, DeclaredTest, declared_test
from analysis.factorial import FactorialCells
from analysis.power import PowerDesign
from analysis.primary_text import primary_sentence
from analysis.report import write_report
from analysis.study import Options
from analysis.synthetic import Truth, write_export
from server.study.analysis_plan import PrimaryTest
from tests.support.declaring import declaring

TWO = {"prediction": ("none", "tom"), "opacity": ("off", "on")}
THREE = {"prediction": ("none", "random", "tom"), "opacity": ("off", "on")}
STUDY = "factors:\n  prediction: [none, tom]\n  opacity: [off, on]\nprimary: {effect: [prediction, opacity]}\n"


def drawn(factors: dict[str, tuple[str, ...]]) -> FactorialCells:
    generator = np.random.default_rng(8)
    count = math.prod(map(len, factors.values()))
    return FactorialCells(
        factors,
        tuple(generator.normal(generator.normal(60, 5), 8, int(generator.integers(4, 12))) for _ in range(count)),
    )


def model_of(cells: FactorialCells):  # type: ignore[no-untyped-def]
    table = pd.DataFrame(
        [{**name, "value": value} for name, values in zip(cells.names, cells.values, strict=True) for value in values]
    )
    return ols("value ~ " + " * ".join(f"C({name}, Sum)" for name in cells.factors), table).fit()


def test_the_study_file_and_the_report_read_the_same_effect() -> None:
    in_the_file = PrimaryTest(effect=("prediction",))
    assert declared_test({"primary": {"effect": ["prediction"]}}) == DeclaredTest(**in_the_file.model_dump())
    assert in_the_file.test == "anova"


@pytest.mark.parametrize("direction", DIRECTIONS)
@pytest.mark.parametrize(
    ("term", "weight", "place"), [(("prediction",), -2, 1), (("opacity",), -2, 2), (("prediction", "opacity"), 4, 3)]
)
def test_one_difference_has_the_numbers_of_statsmodels(
    term: tuple[str, ...], weight: int, place: int, direction: str
) -> None:
    cells = drawn(TWO)
    row = primary.of_effect(DeclaredTest("reward", (), "anova", direction, 0.04, effect=term), cells)
    # Sum coding: the first level counts 1, the last -1, so that a difference is -2 and an interaction 4 coefficients.
    other = model_of(cells).t_test(np.eye(4)[place] * weight)
    two_sided = float(other.pvalue)
    above = two_sided / 2 if float(other.tvalue[0, 0]) > 0 else 1 - two_sided / 2
    assert row.p == pytest.approx({"two_sided": two_sided, "greater": above, "less": 1 - above}[direction])
    alpha = 0.04 if direction == "two_sided" else 0.08
    assert (row.estimate_low, row.estimate_high) == pytest.approx(tuple(other.conf_int(alpha)[0]))
    assert (row.estimate, row.statistic) == pytest.approx((float(other.effect[0]), float(other.tvalue[0, 0])))
    assert row.ci_level == pytest.approx(1 - alpha)


@pytest.mark.parametrize("term", [("prediction",), ("prediction", "opacity")])
def test_more_than_one_difference_has_the_type_iii_test_of_statsmodels(term: tuple[str, ...]) -> None:
    cells = drawn(THREE)
    declared = DeclaredTest("reward", (), "anova", effect=term)
    row = primary.of_effect(declared, cells)
    line = anova_lm(model_of(cells), typ=3).loc[":".join(f"C({name}, Sum)" for name in term)]
    assert (row.statistic, row.p, row.df) == pytest.approx((line["F"], line["PR(>F)"], line["df"]))
    assert math.isnan(row.estimate)
    said = primary_sentence(Declaration(declared), (row,))
    assert ("significant" not in said) == (row.p < 0.05)
    assert "<i>F</i>(2, " in said


@pytest.fixture(scope="module")
def crossed(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """An export in which fading marks help with predictions only, and whose study declares that interaction."""
    folder = tmp_path_factory.mktemp("crossed")
    names = tuple(f"{first}_{second}" for first in TWO["prediction"] for second in TWO["opacity"])
    truth = Truth(participants=14, conditions=names, reward_effect={"tom_on": 30.0}, timesteps=20, seed=3)
    write_export(truth, folder / "plain")
    out = declaring(folder / "plain", folder / "out", STUDY)
    path = out / "participants.parquet"
    parts = pl.col("condition").str.split("_").list
    people = pl.read_parquet(path)
    people.with_columns(factor_prediction=parts.get(0), factor_opacity=parts.get(1)).write_parquet(path)
    return out


@pytest.mark.usefixtures("no_pictures")
def test_a_declared_effect_comes_first_in_the_report(crossed: Path, tmp_path: Path) -> None:
    made = write_report(crossed, tmp_path, Options(power_studies=20, draws=50))
    page = made.page.read_text(encoding="utf-8")
    box = page[page.index('<section class="primary"') : page.index("</section>")]
    assert "Declared: Factorial analysis of variance over simulated participants of the reward" in box
    assert re.search(r"there was an interaction of prediction and opacity on the reward; the difference is ", box)
    assert "(tom - none) x (on - off)" in box
    assert re.search(r"\(difference \+\d+\.\d, 95 % CI \[\d", box)
    with made.results.open(encoding="utf-8", newline="") as stream:
        rows = list(csv.DictReader(stream))
    assert (rows[0]["section"], rows[0]["test"], rows[0]["contrast"]) == ("primary", "anova", "prediction x opacity")
    same = next(row for row in rows if row["section"] == "factorial" and row["contrast"] == "prediction x opacity")
    assert float(rows[0]["p"]) == pytest.approx(float(same["p"]))
    assert "The interaction of prediction and opacity on the reward does not depend on the exclusions" in page


def test_the_power_of_a_declared_effect_is_that_of_its_test(crossed: Path, capsys: pytest.CaptureFixture[str],
    tmp_path: Path, no_pictures: None) -> None:  # fmt: skip
    words = ["power", str(crossed), "--effect", "10", "--studies", "20", "--out", str(tmp_path)]
    assert kitchenmind.main(words) == 0
    line = next(line for line in capsys.readouterr().out.splitlines() if line.startswith("Primary test"))
    assert "Factorial analysis of variance of reward, prediction x opacity, two-sided" in line
    assert "with 14 participants in each of 4 conditions, a true difference of differences of 10 is found" in line


def test_the_power_of_one_direction_is_how_often_the_test_finds_the_difference() -> None:
    declared, levels = DeclaredTest("reward", (), "anova", "less", effect=("a",)), {"a": 2, "b": 3}
    names = {name: tuple(f"{name}{level}" for level in range(count)) for name, count in levels.items()}
    generator, shape = np.random.default_rng(4), factorial_power.smallest_pattern(levels, ("a",)) * -9
    found, studies = 0, 500
    for _ in range(studies):
        values = tuple(generator.normal(mean, 10, 5) for mean in shape.ravel())
        found += primary.of_effect(declared, FactorialCells(names, values)).p < 0.05
    exact = factorial_power.EffectPower(PowerDesign(10, 0, 1), levels, ("a",), one_sided=True).exact(9, 5)
    assert 0.3 < exact < 0.95
    assert abs(found / studies - exact) < 4 * math.sqrt(exact * (1 - exact) / studies)
