"""Power by simulation against the exact formula, and the verb that prints it."""

import csv
import math
import shutil
from pathlib import Path

import numpy as np
import polars as pl
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import stats

import kitchenmind
from analysis import simulated_effect, study_plan
from analysis.power import (
    SIZES,
    PowerDesign,
    curve,
    found_after_correction,
    participants_needed,
    power,
    sentence,
    simulate,
    sizes_for,
    t_test_p,
)
from analysis.power import exact as exact_power
from analysis.simulated_participants import LABEL
from analysis.synthetic import Truth, write_export

DESIGN = PowerDesign(person_sd=8, residual_sd=14)
SPREAD = ("--person-sd", "8", "--residual-sd", "14")


def exact(effect: float, size: int) -> float:
    """Of the t-test over person means, which have variance person_sd^2 + residual_sd^2 / episodes."""
    spread = math.sqrt(8**2 + 14**2 / 10)
    shift = effect / (spread * math.sqrt(2 / size))
    df = 2 * size - 2
    bound = stats.t.ppf(0.975, df)
    return float(stats.nct.sf(bound, df, shift) + stats.nct.cdf(-bound, df, shift))


@pytest.mark.parametrize(("effect", "size"), [(5, 20), (8, 20), (8, 29), (0.001, 29)])
def test_simulated_power_is_the_exact_power_of_the_nested_design(effect: float, size: int) -> None:
    found = power(DESIGN, effect, size, studies=3000)
    truth = exact(effect, size)
    assert found.people == pytest.approx(truth, abs=4 * math.sqrt(truth * (1 - truth) / 3000))


def test_without_a_difference_power_is_alpha() -> None:
    nothing = power(DESIGN, 0.0, 15, studies=3000)
    assert nothing.people == pytest.approx(0.05, abs=0.017)
    assert nothing.some <= 0.075  # correction holds the chance of any false discovery
    assert nothing.comparison <= nothing.some


def test_rewards_vary_between_and_within_people_as_specified() -> None:
    rewards = simulate(DESIGN, 5.0, 200, 20, np.random.default_rng(1))
    assert rewards.shape == (20, 2, 200, 10)
    within = rewards.var(axis=-1, ddof=1).mean()
    assert within == pytest.approx(14**2, rel=0.03)
    assert rewards.mean(axis=-1).var(axis=-1, ddof=1).mean() == pytest.approx(8**2 + 14**2 / 10, rel=0.05)
    assert (rewards[:, 1] - rewards[:, 0]).mean() == pytest.approx(5, abs=0.6)


def test_the_fast_t_test_is_scipys() -> None:
    first, second = np.random.default_rng(2).normal(0, 1, (2, 3, 12, 4))
    assert t_test_p(first, second) == pytest.approx(stats.ttest_ind(first, second, axis=1).pvalue)


@settings(max_examples=100, deadline=None)
@given(st.lists(st.floats(1e-6, 1), min_size=1, max_size=10))
def test_the_fast_correction_rejects_what_the_textbook_rejects(p_values: list[float]) -> None:
    ordered = sorted(p_values)
    k = max(
        (rank for rank in range(1, len(p_values) + 1) if ordered[rank - 1] <= 0.05 * rank / len(p_values)), default=0
    )
    by_hand = [k > 0 and p <= ordered[k - 1] for p in p_values]
    assert found_after_correction(np.array(p_values), 0.05).tolist() == by_hand


def test_the_same_seed_gives_the_same_curve_and_more_people_more_power() -> None:
    first = curve(DESIGN, [8.0], [5, 20, 60], studies=400, seed=3)
    assert first == curve(DESIGN, [8.0], [5, 20, 60], studies=400, seed=3)
    assert first[0].people < first[1].people < first[2].people


def needed_by_hand(effect: float) -> int:
    return next(size for size in range(2, 1000) if exact(effect, size) >= 0.8)


@pytest.mark.parametrize("effect", [3.0, 3.5, 5.0, 8.0, 40.0])
def test_participants_needed_are_the_first_with_the_exact_power(effect: float) -> None:
    assert participants_needed(DESIGN, effect) == participants_needed(DESIGN, -effect) == needed_by_hand(effect)


def test_the_sentence_names_the_number_also_where_the_usual_sizes_end_before() -> None:
    assert needed_by_hand(4.0) > max(SIZES)
    sizes = sizes_for(DESIGN, [4.0], 20)
    assert needed_by_hand(4.0) in sizes  # the curve reaches its goal
    points = curve(DESIGN, [4.0], sizes, studies=20)
    assert f"80 % are reached with {needed_by_hand(4.0)} participants" in sentence(DESIGN, points, 4.0, 20)
    never = curve(DESIGN, [0.0], [20], studies=20)
    assert "80 % are not reached with 100,000" in sentence(DESIGN, never, 0.0, 20)


def test_simulated_power_at_the_needed_number_is_the_wanted_one() -> None:
    found = power(DESIGN, 4.0, needed_by_hand(4.0), studies=4000)
    assert found.people == pytest.approx(0.8, abs=4 * math.sqrt(0.16 / 4000) + 0.005)


def test_a_difference_the_other_way_has_the_same_power() -> None:
    up, down = (power(DESIGN, effect, 20, studies=1500).people for effect in (8.0, -8.0))
    assert down == pytest.approx(up, abs=0.06)


def test_the_verb_reads_a_study_and_a_pilot(
    planted_folder: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    study = tmp_path / "study.yaml"
    study.write_text("layouts: [{name: matrix}, {name: double_rings}]\nagents: [{name: sp}]\norder: {repeat: 2}\n")
    words = ["power", str(study), "--pilot", str(planted_folder), "--effect", "10", "--studies", "50"]
    assert kitchenmind.main([*words, "--out", str(tmp_path / "out")]) == 0
    said = capsys.readouterr().out
    assert "4 episodes a participant" in said
    assert "a true difference of 10 points is found with a probability of" in said
    assert (tmp_path / "out" / "power.svg").read_text().startswith("<?xml")
    with (tmp_path / "out" / "power.csv").open() as stream:
        rows = list(csv.DictReader(stream))
    assert {row["effect"] for row in rows} == {"10.0"}
    assert all(0 <= float(row["people"]) <= 1 for row in rows)


@pytest.mark.parametrize(
    ("text", "words", "reason"),
    [
        ("layouts: [a]\nagents: [b]\n", [], "Give --pilot"),
        ("layouts: [a]\n", [], "needs `layouts` and `agents`"),
        ("- [", [], "is not a study file"),
        ("layouts: [a]\nagents: [b]\n", ["--person-sd", "1", "--residual-sd", "0"], "--residual-sd is out of range"),
        ("layouts: [a]\nagents: [b]\n", [*SPREAD, "--seed", "-1"], "--seed is out of range"),
        ("layouts: [a]\nagents: [b]\n", [*SPREAD, "--effect", "nan"], "--effect is out of range"),
        ("layouts: [a]\nagents: [b]\n", ["--person-sd", "inf", "--residual-sd", "9"], "--person-sd is out of range"),
    ],
)
def test_bad_input_ends_with_status_two_and_a_remedy(
    text: str, words: list[str], reason: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "study.yaml").write_text(text)
    assert kitchenmind.main(["power", str(tmp_path / "study.yaml"), "--effect", "5", *words]) == 2
    assert reason in capsys.readouterr().err


def test_a_missing_study_file_is_named(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert kitchenmind.main(["power", str(tmp_path / "none.yaml"), "--effect", "5"]) == 2
    assert "none.yaml" in capsys.readouterr().err


def test_a_negative_effect_is_a_difference_too(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "study.yaml").write_text("layouts: [a, b]\nagents: [c, d]\n")
    words = ["power", str(tmp_path / "study.yaml"), "--effect", "-5", "5", "--studies", "50", *SPREAD]
    assert kitchenmind.main([*words, "--out", str(tmp_path / "out")]) == 0
    down, up = capsys.readouterr().out.splitlines()[:2]
    assert "a true difference of -5 points" in down
    assert down.split("80 % are reached")[1] == up.split("80 % are reached")[1]


def test_one_of_two_studies_is_chosen_for_power(
    planted_folder: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    folder = tmp_path / "data"
    shutil.copytree(planted_folder, folder)
    people = pl.read_parquet(folder / "participants.parquet")
    pilot = pl.when(pl.int_range(pl.len()) < 12).then(pl.lit("pilot")).otherwise(pl.col("study"))
    people.with_columns(study=pilot).write_parquet(folder / "participants.parquet")
    words = ["--effect", "10", "--studies", "50", "--out", str(tmp_path / "out")]
    assert kitchenmind.main(["power", str(folder), *words]) == 2
    assert "Choose one with --study: pilot, simulated" in capsys.readouterr().err
    assert kitchenmind.main(["power", str(folder), "--study", "pilot", *words]) == 0
    assert "with 4 participants in each condition" in capsys.readouterr().out
    (tmp_path / "study.yaml").write_text("layouts: [a, b]\nagents: [c, d]\n")
    words += ["--pilot", str(folder), "--study", "simulated"]
    assert kitchenmind.main(["power", str(tmp_path / "study.yaml"), *words]) == 0
    assert simulated_effect.VARIANCES in capsys.readouterr().out
    assert LABEL in (tmp_path / "out" / "power.svg").read_text(encoding="utf-8")


def test_the_simulated_effect_is_a_source_that_is_named(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "study.yaml").write_text("layouts: [a, b]\nagents: [c, d]\n")
    words = ["power", str(tmp_path / "study.yaml"), "--simulated-effect", *SPREAD, "--studies", "50"]
    assert kitchenmind.main([*words, "--out", str(tmp_path / "out")]) == 0
    said = capsys.readouterr().out
    assert f"The effect of {simulated_effect.points():g} points comes from simulated participants" in said
    assert f"a true difference of {simulated_effect.points():g} points is found" in said
    assert "It is not evidence about people" in said
    assert LABEL in (tmp_path / "out" / "power.svg").read_text(encoding="utf-8")
    assert f",{LABEL}\n" in (tmp_path / "out" / "power.csv").read_text(encoding="utf-8")


def test_power_without_any_effect_is_refused_with_the_remedy(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "study.yaml").write_text("layouts: [a, b]\nagents: [c, d]\n")
    assert kitchenmind.main(["power", str(tmp_path / "study.yaml"), *SPREAD]) == 2
    assert "give --effect with the true differences to be found, or --simulated-effect" in capsys.readouterr().err


def test_in_a_study_for_two_each_analysed_participant_takes_two_people(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    for human, is_said in (("true", True), ("false", False)):
        file = tmp_path / "study.yaml"
        file.write_text(f"layouts: [a, b]\nagents: [{{name: person, human: {human}}}]\n")
        words = ["power", str(file), "--effect", "12", "--studies", "20", "--person-sd", "8", "--residual-sd", "14"]
        assert kitchenmind.main([*words, "--out", str(tmp_path / "out")]) == 0
        assert ("recruit two people for each of them" in capsys.readouterr().out) is is_said


@pytest.mark.parametrize(
    ("conditions", "sizes"),
    [
        ("[{name: none, weight: 2}, {name: tom}]", "none 2, tom 1"),
        ("[{name: none, quota: 40}, {name: tom, quota: 20, weight: 5}]", "none 40, tom 20"),
        ("[{name: none, quota: 40, weight: 2}, {name: tom, weight: 2}]", ""),
        ("[{name: none}, {name: tom}]", ""),
    ],
)
def test_unequal_conditions_are_named_with_the_number_that_counts(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], conditions: str, sizes: str
) -> None:
    file = tmp_path / "study.yaml"
    file.write_text(f"layouts: [a, b]\nagents: [c]\nconditions: {conditions}\n")
    words = ["power", str(file), "--effect", "12", "--studies", "20", "--person-sd", "8", "--residual-sd", "14"]
    assert kitchenmind.main([*words, "--out", str(tmp_path / "out")]) == 0
    assert ("unequal numbers" in capsys.readouterr().out) is bool(sizes)
    assert study_plan.plan_of_study_file(file).unequal == tuple(sizes.split(", ") if sizes else ())


def test_unequal_conditions_have_about_the_power_of_their_harmonic_mean() -> None:
    generator = np.random.default_rng(4)
    first, second = generator.normal(0.7, 1, (4000, 60)), generator.normal(0, 1, (4000, 20))
    found = float((stats.ttest_ind(first, second, axis=1).pvalue < 0.05).mean())
    assert found == pytest.approx(exact_power(PowerDesign(1.0, 0.0, 1), 0.7, 2 * 60 * 20 // 80), abs=0.03)


def test_a_pilot_of_one_episode_a_person_says_what_can_be_given_instead(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    truth = Truth(participants=8, conditions=("none", "tom"), layouts=("matrix",), agents=("sp",), timesteps=3)
    write_export(truth, tmp_path)
    assert kitchenmind.main(["power", str(tmp_path), "--effect", "5", "--out", str(tmp_path / "out")]) == 2
    assert "Give both --person-sd and --residual-sd with a study file." in capsys.readouterr().err


def test_a_pilot_with_one_person_in_a_condition_needs_a_number(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    write_export(Truth(participants=7, conditions=("none", "tom"), layouts=("matrix",), timesteps=3), tmp_path)
    people = pl.read_parquet(tmp_path / "participants.parquet")
    one = people.filter(pl.col("condition") == "tom").head(1)
    pl.concat([people.filter(pl.col("condition") == "none"), one]).write_parquet(tmp_path / "participants.parquet")
    assert kitchenmind.main(["power", str(tmp_path), "--effect", "5", "--out", str(tmp_path / "out")]) == 2
    assert "fewer than two participants. Give --participants." in capsys.readouterr().err
