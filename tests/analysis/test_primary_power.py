"""The power of the declared primary test: the numbers of textbooks, and what the command prints."""

import math
import re
from pathlib import Path

import numpy as np
import polars as pl
import pytest
from statsmodels.regression.mixed_linear_model import MixedLM

import kitchenmind
from analysis import primary_power
from analysis.declared import DIRECTIONS, TESTS, DeclaredTest
from analysis.synthetic import Truth, write_export
from tests.support.declaring import declaring


@pytest.mark.parametrize("direction", DIRECTIONS)
@pytest.mark.parametrize("test", TESTS)
def test_the_power_of_a_declared_test_is_that_of_the_textbook(test: str, direction: str) -> None:
    from statsmodels.stats.power import TTestIndPower

    declared = DeclaredTest("reward", ("tom", "none"), test, direction, alpha=0.03)
    design = primary_power.PrimaryDesign(declared, 8.0, 14.0, 6)
    sd = math.sqrt(64 + 196 / 6)
    sides = "two-sided" if direction == "two_sided" else "larger"
    truth = TTestIndPower().power(7 / sd, 25, 0.03, alternative=sides)
    effect = -7.0 if direction == "less" else 7.0
    slack = 4 * math.sqrt(truth * (1 - truth) / 4000)
    found = primary_power.simulated(design, effect, 25, 4000, seed=1)
    if test == "mann_whitney":  # 95.5 % as efficient where values are normal (Hodges and Lehmann 1956)
        truth = TTestIndPower().power(7 / sd, 25 * 0.955, 0.03, alternative=sides)
    assert found == pytest.approx(truth, abs=slack + 0.01)
    if test != "mann_whitney":
        assert primary_power.exact(design, effect, 25) == pytest.approx(truth, abs=1e-6)
        needed = primary_power.participants_needed(design, effect)
        assert needed == math.ceil(TTestIndPower().solve_power(7 / sd, None, 0.03, 0.8, alternative=sides))


def test_the_power_command_covers_the_declared_test(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    file = tmp_path / "study.yaml"
    file.write_text(
        "layouts: [a, b, c]\nagents: [d, e]\n"
        "primary: {comparison: [tom, none], direction: greater, layouts: [a, b], agents: [d]}\n"
    )
    words = ["power", str(file), "--effect", "8", "--studies", "200", "--person-sd", "8", "--residual-sd", "14"]
    assert kitchenmind.main([*words, "--out", str(tmp_path / "out")]) == 0
    out = capsys.readouterr().out
    line = next(line for line in out.splitlines() if line.startswith("Primary test of the study file"))
    assert "Welch’s t-test of reward, tom - none, greater, alpha = 0.05; 2 episodes a participant" in line
    design = primary_power.PrimaryDesign(DeclaredTest("reward", ("tom", "none"), direction="greater"), 8, 14, 2)
    assert f"80 % are reached with {primary_power.participants_needed(design, 8)} participants" in line
    file.write_text("layouts: [a]\nagents: [d]\nprimary: {comparison: [tom]}\n")
    assert kitchenmind.main([*words, "--out", str(tmp_path / "out")]) == 2
    assert "primary.comparison: it needs two different conditions" in capsys.readouterr().err


def test_the_power_of_a_declared_question_comes_from_a_pilot(
    planted_folder: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    text = "primary: {measure: efficiency, comparison: [tom, none], layouts: [matrix, double_rings]}\n"
    file = tmp_path / "study.yaml"
    file.write_text("layouts: [a, b, c]\nagents: [d, e]\n" + text)
    words = ["power", str(file), "--pilot", str(planted_folder), "--effect", "8", "--studies", "50"]
    words += ["--out", str(tmp_path / "out")]
    assert kitchenmind.main(words) == 0
    assert "give --answer-effect and a pilot" in capsys.readouterr().out
    assert kitchenmind.main([*words, "--answer-effect", "0.5"]) == 0
    line = next(line for line in capsys.readouterr().out.splitlines() if line.startswith("Primary test"))
    between, within = (float(value) for value in re.findall(r"(\d+\.?\d*) (?:between|within)", line))
    assert (between, within) == pytest.approx(spread_of_answers(planted_folder), abs=0.06)
    assert "4 episodes a participant" in line
    assert "a true difference of 0.5 is found" in line


def spread_of_answers(folder: Path) -> tuple[float, float]:
    """Standard deviations of the answers between and within people, by statsmodels."""
    answers = pl.read_parquet(folder / "answers.parquet").filter(pl.col("question") == "efficiency")
    episodes = pl.read_parquet(folder / "episodes.parquet").filter(
        pl.col("layout").is_in(["matrix", "double_rings"]) & (pl.col("excluded") == "")
    )
    table = answers.join(episodes, on="episode").with_columns(value=pl.col("value").cast(pl.Float64))
    x = [np.ones(table.height), table["layout"] == "matrix", table["agent_1"] == "fcp"]
    x += [table["condition"] == name for name in ("random", "tom")]
    _, person = np.unique(table["participant_0"].to_numpy(), return_inverse=True)
    fitted = MixedLM(table["value"].to_numpy(), np.stack(x, axis=1).astype(float), person).fit(reml=True)
    return math.sqrt(float(np.asarray(fitted.cov_re)[0, 0])), math.sqrt(float(fitted.scale))


def test_an_export_brings_its_own_declaration_for_power(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    write_export(Truth(participants=6, layouts=("matrix", "double_rings"), timesteps=10, seed=3), tmp_path / "plain")
    folder = declaring(tmp_path / "plain", tmp_path / "data", "primary: {comparison: [tom, none], agents: [sp]}\n")
    words = ["power", str(folder), "--effect", "8", "--studies", "50", "--out", str(tmp_path / "out")]
    assert kitchenmind.main(words) == 0
    assert "alpha = 0.05; 2 episodes a participant" in capsys.readouterr().out
