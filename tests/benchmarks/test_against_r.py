"""The report's numbers are those of R, which are kept from its last run; the tests need no R."""

import importlib.util
import math
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parent.parent.parent
spec = importlib.util.spec_from_file_location("against_r", ROOT / "benchmarks" / "against_r.py")
benchmark = importlib.util.module_from_spec(spec)
sys.modules[spec.name] = benchmark
spec.loader.exec_module(benchmark)

CASES = {case.name: case for case in benchmark.CASES}
QUICK = ("unbalanced", "few", "three_blocks")
KEPT = benchmark.kept()
NEAR = 1e-6
# docs/explanation/statistics.md says why these differ more.
NEARER_TO_THE_MAXIMUM = 2e-3  # clmm stops its search earlier
OTHER_INFORMATION = 0.02  # expected, not observed: degrees of freedom, and what follows from them
SEARCHED = 1e-5  # random slopes: where two searches stop
STANDARD_ERRORS = 4.5
WITHOUT_OURS = {("ordinal", "person_sd")}  # answers of some conditions do not overlap: R has estimates, but no errors


def allowed(each) -> float:
    section, test = each.key[:2]
    if each.field == benchmark.MONTE_CARLO:
        return STANDARD_ERRORS
    if section == "ordinal":
        return NEARER_TO_THE_MAXIMUM
    if section == "mixed model" or test in ("with_round", "round", "round_by_condition"):
        return OTHER_INFORMATION if each.field in ("df", "p", "estimate_low", "estimate_high") else SEARCHED
    return SEARCHED if test in ("random_slopes", "slope_sd") else NEAR


@pytest.mark.parametrize(
    "name", [name if name in QUICK else pytest.param(name, marks=pytest.mark.slow) for name in CASES]
)
def test_every_number_is_that_of_r(name: str) -> None:
    found = [each for each in benchmark.compared(CASES[name], KEPT) if not each.field.startswith("satterthwaite")]
    assert len(found) > 500
    missing = [each for each in found if math.isnan(each.ours) and not (each.field == "df" and each.of_r == 0)]
    assert {each.key[:2] for each in missing} <= (WITHOUT_OURS if name == "separated" else set())
    assert [each for each in found if each.difference > allowed(each)] == []


@pytest.mark.slow
def test_the_document_shows_the_comparison() -> None:
    found = [each for case in benchmark.CASES for each in benchmark.compared(case, KEPT)]
    text = benchmark.DOCUMENT.read_text(encoding="utf-8")
    for line in benchmark.rendered(found, ()).splitlines()[3:-3]:
        what, _, count = line.split(" | ")[:3]
        assert f"{what} | " in text
        assert f"| {count} |" in text, "Run: python benchmarks/against_r.py --write"
