"""Compare the report's numbers with R: simulated studies are analysed here, and again by packages of R.

    python benchmarks/against_r.py            compares and prints the table
    python benchmarks/against_r.py --write    also writes R's numbers and the table in docs/explanation/statistics.md

It needs R with the packages that against_r.R names. Nothing else in the project needs R: the tests compare the report
with R's numbers as they were written.
"""

import csv
import gzip
import math
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
# `training.py` next to this file has the name of a package: remove this folder from the module search path.
sys.path[:] = [str(ROOT), *(folder for folder in sys.path if Path(folder).resolve() != ROOT / "benchmarks")]

from analysis.results import Result  # noqa: E402
from analysis.study import Options, analyse  # noqa: E402
from analysis.tables import read_export  # noqa: E402
from benchmarks.support import kept_figures  # noqa: E402
from benchmarks.support.r_cases import CASES, Case, write_case  # noqa: E402

WITHOUT_PACKAGES = 3  # the exit status of the script where R lacks a package
SCRIPT = Path(__file__).with_suffix(".R")
KEPT = ROOT / "tests" / "data" / "numbers_of_r.csv.gz"
DOCUMENT = ROOT / "docs" / "explanation" / "statistics.md"
BEGIN, END = "<!-- table of benchmarks/against_r.py -->", "<!-- end of the table -->"
KEY = ("section", "test", "layout", "agent", "condition", "contrast", "question")
COLUMNS = ("case", *KEY, "field", "value")
OPTIONS = Options(power_studies=20)
MONTE_CARLO = "monte_carlo_p"  # p from random draws, here or in R
DRAWS = (OPTIONS.draws, 5000)  # here and in R
FLOOR = 0.01  # differences are relative to R's number, or to this where it is smaller

# Rows of the table: what, by which function of R, and its (section, test) in results.csv; an empty test means all.
TABLE: tuple[tuple[str, str, tuple[tuple[str, str], ...]], ...] = (
    ("means with intervals", "t.test", (("reward", "mean"), ("questionnaire", "mean"), ("scale", "mean"))),
    ("one-way analyses of variance", "aov, oneway.test", (("reward", "anova"), ("reward", "anova_people"),
     ("reward", "welch_anova"))),
    ("Kruskal-Wallis, epsilon squared", "kruskal.test, effectsize", (("reward", "kruskal_wallis"),)),
    ("t-tests, Hedges' g", "t.test, effectsize, pt", (("reward", "t_test"), ("reward", "t_test_people"),
     ("questionnaire", "t_test"), ("questionnaire", "t_test_people"), ("scale", "t_test_people"),
     ("simple effects", ""))),
    ("Welch's t-tests, Cliff's delta", "t.test, aov", (("reward", "welch_t_test"),)),
    ("assumptions", "shapiro.test, car", (("assumptions", ""),)),
    ("mixed model of reward", "lme4, lmerTest", (("mixed model", ""),)),
    ("cluster-robust errors", "clubSandwich (CR2)", (("robustness", "cluster_robust"),)),
    ("random slopes", "lme4", (("robustness", "random_slopes"), ("robustness", "slope_sd"))),
    ("round as covariate", "lme4, lmerTest", (("robustness", "with_round"), ("robustness", "round"),
     ("robustness", "round_by_condition"))),
    ("cumulative-link mixed model", "ordinal::clmm", (("ordinal", ""),)),
    ("reliability of scales", "psych::alpha", (("scale", "alpha"), ("scale", "spearman_brown"))),
    ("equivalence", "t.test", (("equivalence", ""),)),
    ("factors", "car::Anova, afex, emmeans", (("factorial", ""), ("factorial simple effects", ""))),
    ("primary test, interim looks", "t.test, wilcox.test, rpact", (("primary", ""),)),
    ("sensitivity to exclusions", "the same", (("sensitivity", ""),)),
    ("attrition", "chisq.test, fisher.test", (("attrition", ""),)),
    ("permutations over people", "sample", ()),
)  # fmt: skip


@dataclass(frozen=True)
class Compared:
    """A number of R next to the report's. `ours` is nan where the report has none."""

    case: str
    key: tuple[str, ...]
    field: str
    ours: float
    of_r: float

    @property
    def difference(self) -> float:
        """Relative; of p from random draws, in standard errors."""
        apart = abs(self.ours - self.of_r)
        if self.field != MONTE_CARLO:
            return apart / max(abs(self.of_r), FLOOR)
        p = min(max(self.of_r, 1e-4), 1 - 1e-4)
        return apart / math.sqrt(p * (1 - p) * sum(1 / draws for draws in DRAWS))


def main() -> None:
    arguments = kept_figures.parsed(__doc__)
    if shutil.which("Rscript") is None:
        print("R is not installed: nothing to compare. against_r.R names the packages that it needs.")
        raise SystemExit(1 if arguments.write else 0)
    cases = CASES[:1] if arguments.quick else CASES
    numbers, versions = numbers_of_r(cases)
    table = rendered([each for case in cases for each in compared(case, numbers)], versions)
    print(table)
    if arguments.write:
        keep(numbers)
        kept_figures.put(table, DOCUMENT, BEGIN, END)


def numbers_of_r(cases: Sequence[Case]) -> tuple[list[dict[str, str]], list[str]]:
    """Run R on each case: its numbers, and the versions of R and its packages."""
    numbers: list[dict[str, str]] = []
    with tempfile.TemporaryDirectory() as folder:
        for case in cases:
            place = Path(folder) / case.name
            write_case(case, place)
            flags = analyse(read_export(place), OPTIONS).quality
            flags.select("episode", "participant", "proposal").write_csv(place / "flags.csv")
            command = ["Rscript", str(SCRIPT), str(place), str(place / "r.csv")]
            done = subprocess.run(command, check=False, capture_output=True, text=True)
            if done.returncode == WITHOUT_PACKAGES:
                raise SystemExit(done.stderr.strip())
            done.check_returncode()
            output = done.stdout
            with (place / "r.csv").open(encoding="utf-8") as stream:
                numbers += [{"case": case.name, **row} for row in csv.DictReader(stream)]
    return numbers, output.split("\n")[:-1]


def keep(numbers: Sequence[Mapping[str, str]]) -> None:
    """Write R's numbers for the tests; the same numbers give the same bytes."""
    lines = [",".join(COLUMNS), *(",".join(row[name] for name in COLUMNS) for row in numbers)]
    KEPT.write_bytes(gzip.compress("\n".join(lines).encode(), mtime=0))


def kept() -> list[dict[str, str]]:
    """Read them."""
    return list(csv.DictReader(gzip.decompress(KEPT.read_bytes()).decode().splitlines()))


def compared(case: Case, numbers: Sequence[Mapping[str, str]]) -> Iterator[Compared]:
    """Analyse the case and compare each of R's numbers about it."""
    with tempfile.TemporaryDirectory() as folder:
        write_case(case, Path(folder) / case.name)
        rows = analyse(read_export(Path(folder) / case.name), OPTIONS).rows
    ours: dict[tuple[str, ...], Result] = {}
    for row in rows:
        ours.setdefault(tuple(str(getattr(row, name)) for name in KEY), row)
    for number in numbers:
        if number["case"] == case.name:
            key, field = tuple(number[name] for name in KEY), number["field"]
            found = getattr(ours.get(key), "p" if field == MONTE_CARLO else field, math.nan)
            yield Compared(case.name, key, field, float(found), float(number["value"]))


def rendered(found: Sequence[Compared], versions: Sequence[str]) -> str:
    """Return the table with its marks."""
    lines = [BEGIN, "| numbers | function or package of R | compared | largest difference |", "|---|---|---|---|"]
    for what, how, parts in TABLE:
        mine = [each for each in found if _belongs(each, parts) and math.isfinite(each.ours)]
        if mine:
            largest = max(each.difference for each in mine)
            shown = f"{largest:.1g}" if parts else f"{largest:.1f} standard errors"
            lines.append(f"| {what} | {how} | {len(mine):,} | {shown} |")
    return "\n".join([*lines, "", f"{', '.join(versions)}.", END])


def _belongs(each: Compared, parts: Sequence[tuple[str, str]]) -> bool:
    if each.field == MONTE_CARLO or not parts:
        return each.field == MONTE_CARLO and not parts
    return any(each.key[0] == section and test in ("", each.key[1]) for section, test in parts)


if __name__ == "__main__":
    main()
