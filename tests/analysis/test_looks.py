"""Declared interim looks: boundaries against published ones, the level they hold, and what the report says."""

import math
from pathlib import Path

import numpy as np
import pytest
from scipy import stats

import kitchenmind
from analysis import primary, primary_power
from analysis.alpha_spending import SPENDING, Look, boundaries, current_look, nominal_levels, spent
from analysis.declared import Declaration, DeclaredTest, declared_test
from analysis.primary_text import primary_lines, primary_sentence
from analysis.report import write_report
from analysis.study import Options
from server.study.analysis_plan import PrimaryTest
from tests.support.declaring import declaring

QUICK = Options(power_studies=20, draws=50)

# Five equal looks, two-sided .05 (Reboussin, DeMets, Kim and Lan 2000: program ld98, R package ldbounds); three equal
# looks, one-sided .025 (R packages gsDesign and rpact).
PUBLISHED = [
    ("obrien_fleming", True, 0.05, 5, [4.8769, 3.3569, 2.6803, 2.2898, 2.0310]),
    ("pocock", True, 0.05, 5, [2.4380, 2.4268, 2.4101, 2.3966, 2.3859]),
    ("obrien_fleming", False, 0.025, 3, [3.7103, 2.5114, 1.9930]),
    ("pocock", False, 0.025, 3, [2.2794, 2.2949, 2.2959]),
]


@pytest.mark.parametrize(("kind", "two_sided", "alpha", "count", "published"), PUBLISHED)
def test_boundaries_are_the_published_ones(
    kind: str, two_sided: bool, alpha: float, count: int, published: list[float]
) -> None:
    looks = [20 * number for number in range(1, count + 1)]
    found = nominal_levels(looks, looks[-1], alpha, kind, two_sided)
    assert [look.boundary for look in found] == pytest.approx(published, abs=2e-4)


def test_spending_is_that_of_lan_and_demets() -> None:
    assert spent("pocock", 0.025, 0.2) == pytest.approx(0.025 * math.log(1 + (math.e - 1) * 0.2))
    assert spent("obrien_fleming", 0.025, 0.5) == pytest.approx(2 * (1 - stats.norm.cdf(2.2414027 / math.sqrt(0.5))))
    for kind in SPENDING:
        assert spent(kind, 0.025, 0) == 0
        assert spent(kind, 0.025, 1) == spent(kind, 0.025, 1.3) == pytest.approx(0.025)


@pytest.mark.parametrize("two_sided", [True, False])
@pytest.mark.parametrize("kind", SPENDING)
def test_unequal_looks_spend_what_they_may_by_scipys_normal_distribution(kind: str, two_sided: bool) -> None:
    looks = [24, 37, 80]
    found = nominal_levels(looks, 80, 0.04, kind, two_sided)
    side = 0.02 if two_sided else 0.04
    for count in (1, 2, 3):
        bounds = np.array([look.boundary for look in found[:count]])
        part = np.array(looks[:count], dtype=float)
        correlation = np.sqrt(np.minimum.outer(part, part) / np.maximum.outer(part, part))
        low = -bounds if two_sided else np.full(count, -12.0)
        stay = stats.multivariate_normal.cdf(
            bounds, cov=correlation, lower_limit=low, abseps=1e-9, releps=1e-9, maxpts=2_000_000, rng=1
        )
        allowed = (2 if two_sided else 1) * spent(kind, side, looks[count - 1] / 80)
        assert 1 - stay == pytest.approx(allowed, abs=2e-5)


def test_one_look_at_the_end_is_the_plain_test() -> None:
    (look,) = nominal_levels([50], 50, 0.05, "obrien_fleming", True)
    assert look.boundary == pytest.approx(stats.norm.ppf(0.975))
    assert look.nominal_alpha == pytest.approx(0.05)
    assert boundaries([9.0], [0.01], False) == pytest.approx([stats.norm.ppf(0.99)])


def test_the_look_is_the_nearest_declared_one() -> None:
    looks = (30, 60, 90)
    assert current_look(looks, 29, 0.05, "pocock", True) is None

    def at(people: int) -> Look:
        found = current_look(looks, people, 0.05, "pocock", True)
        assert found is not None
        return found

    plain = nominal_levels(looks, 90, 0.05, "pocock", True)
    assert [at(people) for people in looks] == [
        Look(look.number, 3, look.people, 90, pytest.approx(look.boundary), pytest.approx(look.nominal_alpha))
        for look in plain
    ]
    assert [at(people).number for people in (31, 44, 45, 59, 74, 75, 89)] == [1, 1, 2, 2, 2, 3, 3]
    more = at(100)
    assert (more.number, more.people) == (3, 100)
    assert more.boundary == pytest.approx(nominal_levels([30, 60, 100], 90, 0.05, "pocock", True)[-1].boundary), (
        "more people than planned: all of alpha is spent at their own information"
    )


def test_the_study_file_and_the_report_know_the_same_looks() -> None:
    assert set(PrimaryTest.model_fields["spending"].annotation.__args__) == set(SPENDING)  # type: ignore[union-attr]
    texts = {"primary": {"comparison": ["tom", "none"], "looks": ["30", "60"], "spending": "pocock"}}
    found = declared_test(texts)
    assert found is not None
    assert (found.looks, found.spending) == ((30, 60), "pocock")
    for looks in (["60", "30"], ["soon"], ["2", "30"]):
        with pytest.raises(ValueError, match=r"primary.looks: these are not growing numbers"):
            declared_test({"primary": {"comparison": ["tom", "none"], "looks": looks}})


def lines(declared: DeclaredTest, people: int, shift: float) -> list[str]:
    half = stats.norm.ppf((np.arange(people // 2) + 0.5) / (people // 2))
    row = primary.compared(declared, 60 + shift + 10 * half, 60 + 10 * half)
    return primary_lines(Declaration(declared), (row,))


def test_significance_at_a_look_is_crossing_its_boundary() -> None:
    """A difference with p = .02: not enough at the first of three looks, enough without looks."""
    plain = DeclaredTest("reward", ("tom", "none"))
    looks = DeclaredTest("reward", ("tom", "none"), looks=(40, 80, 120))
    assert "was significantly higher" in " ".join(lines(plain, 40, 7.5))
    said = " ".join(lines(looks, 40, 7.5))
    assert "looks at 40, 80 and 120 people, O’Brien-Fleming-type spending" in said
    assert "This is look 1 of 3, at 40 people: the boundary is |z| = 3.710, a nominal level of 0.00021." in said
    assert "It is not crossed. No other test may decide whether the study stops." in said
    assert "did not differ significantly" in said
    crossed = " ".join(lines(looks, 40, 20))
    assert "It is crossed." in crossed
    assert "was significantly higher" in crossed
    assert "99.98 % CI [" in crossed
    assert "This is the last look." in " ".join(lines(looks, 120, 7.5))


def test_a_report_between_two_looks_warns_that_it_must_be_the_only_one() -> None:
    looks = DeclaredTest("reward", ("tom", "none"), looks=(40, 80, 120))
    warning = "Look 1 was declared at 40 people, and this is computed at 46. The boundary holds only if"
    assert warning in " ".join(lines(looks, 46, 7.5))
    assert "holds only if the primary test was not computed before: every further" in " ".join(lines(looks, 46, 7.5))
    last = " ".join(lines(looks, 116, 7.5))
    assert "This is look 3 of 3, at 116 people" in last
    assert "holds only if the primary test was computed before at 40 and 80 people only: every" in last
    for people in (40, 80, 120):
        assert "The boundary holds only if" not in " ".join(lines(looks, people, 7.5))
    assert "Look 3 was declared at 120 people, and this is computed at 124." in " ".join(lines(looks, 124, 7.5))


def test_reports_between_looks_would_not_hold_alpha() -> None:
    """Twelve reports under the boundaries of three looks, without an effect: as the warning says."""
    declared = DeclaredTest("reward", ("tom", "none"), looks=(40, 80, 120), spending="pocock")
    chance = np.random.default_rng(7)
    sums = chance.normal(size=(20_000, 12)).cumsum(axis=1) * math.sqrt(10)  # 10 people more at each report
    people = 10 * np.arange(1, 13)
    bounds = [look.boundary if (look := primary.look_at(declared, int(n))) else math.inf for n in people]
    crossed = np.abs(sums / np.sqrt(people)) > bounds
    assert crossed[:, [3, 7, 11]].any(axis=1).mean() == pytest.approx(0.05, abs=0.005)
    assert crossed.any(axis=1).mean() > 0.06


@pytest.mark.parametrize("kind", SPENDING)
@pytest.mark.parametrize("people", [(40, 77), (40, 80, 117), (43, 84, 128), (52, 75)])
def test_the_looks_hold_alpha_with_a_few_people_less_or_more(kind: str, people: tuple[int, ...]) -> None:
    """The last look often has fewer people than declared, as some were excluded."""
    declared = DeclaredTest("reward", ("tom", "none"), looks=(40, 80, 120)[: len(people)], spending=kind)
    chance = np.random.default_rng(5)
    steps = np.sqrt(np.diff([0, *people]))
    sums = (chance.normal(size=(200_000, len(people))) * steps).cumsum(axis=1)
    bounds = [look.boundary for n in people if (look := primary.look_at(declared, n))]
    assert (np.abs(sums / np.sqrt(people)) > bounds).any(axis=1).mean() < 0.052


def test_before_the_first_look_the_primary_test_is_not_computed() -> None:
    declared = DeclaredTest("reward", ("tom", "none"), looks=(40, 80))
    row = primary.compared(declared, np.arange(10.0), np.arange(10.0) + 30)
    assert math.isnan(row.p)
    assert primary_sentence(Declaration(declared), (row,)) == (
        "The primary test is not computed before the first declared look, which is at 40 people."
    )
    assert "With 20 people, no look is due: the primary test is not computed." in " ".join(lines(declared, 20, 30))


def test_without_people_the_reason_is_a_sentence_of_its_own() -> None:
    declared = DeclaredTest("reward", ("tom", "none"), looks=(40, 80))
    row = primary.compared(declared, np.array([3.0]), np.array([]))
    words = "The primary test is not computed: fewer than two values in a condition."
    assert primary_sentence(Declaration(declared), (row,)) == words
    assert "With 1 person, no look is due" in " ".join(primary_lines(Declaration(declared), (row,)))


@pytest.mark.usefixtures("no_pictures")
def test_the_report_names_its_interim_look(planted_folder: Path, tmp_path: Path) -> None:
    text = "primary: {comparison: [tom, none], looks: [20, 60], spending: pocock}\n"
    made = write_report(declaring(planted_folder, tmp_path / "data", text), tmp_path / "out", QUICK)
    page = made.page.read_text(encoding="utf-8")
    assert "This is look 1 of 2, at 32 simulated participants" in page
    (look,) = nominal_levels([32], 60, 0.05, "pocock", True)
    assert made.analysis.rows[0].ci_level == pytest.approx(1 - look.nominal_alpha)
    assert f"look 1 of 2, nominal alpha = {look.nominal_alpha:.3g}" in made.analysis.rows[0].note


@pytest.mark.parametrize("kind", SPENDING)
def test_looks_hold_alpha_and_cost_little_power(kind: str) -> None:
    declared = DeclaredTest("reward", ("tom", "none"), "student", looks=(40, 80, 120), spending=kind)
    design = primary_power.PrimaryDesign(declared, 8.0, 14.0, 10)
    alarms, people = primary_power.simulated_with_looks(design, 0.0, 6000, seed=1)
    assert alarms == pytest.approx(0.05, abs=4 * math.sqrt(0.05 * 0.95 / 6000) + 0.002)  # t is not quite normal
    assert 110 < people <= 120
    found, people = primary_power.simulated_with_looks(design, 5.0, 4000, seed=1)
    plain = primary_power.exact(design, 5.0, 60)
    assert plain - 0.08 < found <= plain + 0.02
    assert people < 105


def test_looks_at_undeclared_levels_would_not_hold_alpha() -> None:
    """What the boundaries are for: three tests at .05 give about eleven false alarms in a hundred studies."""
    generator = np.random.default_rng(3)
    first, second = generator.normal(size=(2, 4000, 60))
    p = [stats.ttest_ind(first[:, :half], second[:, :half], axis=1).pvalue for half in (20, 40, 60)]
    assert (np.min(p, axis=0) < 0.05).mean() > 0.09


def test_the_power_command_uses_the_declared_looks(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    file = tmp_path / "study.yaml"
    file.write_text("layouts: [a, b]\nagents: [c]\nprimary: {comparison: [tom, none], looks: [20, 40]}\n")
    words = ["power", str(file), "--effect", "12", "--studies", "200", "--person-sd", "8", "--residual-sd", "14"]
    assert kitchenmind.main([*words, "--out", str(tmp_path / "out")]) == 0
    line = next(line for line in capsys.readouterr().out.splitlines() if line.startswith("Primary test"))
    assert "with looks at 20, 40 people, obrien_fleming spending, " in line
    assert "people on average, a true difference of 12 is found with a probability of" in line
