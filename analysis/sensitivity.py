"""Check whether the main comparison depends on exclusions, and whether attrition differs between the conditions."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import polars as pl
from scipy import stats

from analysis import primary
from analysis.declared import DeclaredTest
from analysis.exclusions import watched_partners
from analysis.groups import computed
from analysis.results import Result
from analysis.simulated_participants import Subjects
from analysis.tables import Export

SECTION = "sensitivity"
ATTRITION = "attrition"
MIN_EXPECTED = 5  # people in a cell below which chi-square is not trusted
RESAMPLES = 9999


def populations(who: Subjects) -> dict[str, str]:
    """Return whom the declared test is computed over, in words."""
    return {
        "analysed": "as analysed in this report",
        "assigned": "all who were assigned, every finished episode, exclusions undone",
        "completed": "all who finished the study, exclusions undone",
        "no_drop": f"as analysed, without {who.people} of whom a rule proposes to drop an episode",
        "no_flag": f"as analysed, without {who.people} of whom a rule flags an episode",
    }


def sensitivity_rows(
    declared: DeclaredTest, every: pl.DataFrame, analysed: pl.DataFrame, quality: pl.DataFrame, export: Export
) -> list[Result]:
    """Return the declared test over each of `populations`. `every`: all episodes with their measures; `quality`: their
    decisions. At an interim look, all have the level of the people analysed; before the first one there are none."""
    finished = every.filter(pl.col("status") == "done")
    completed = export.participants.filter(pl.col("status") == "completed").select("participant")
    flagged = quality.join(analysed.select("episode"), on="episode", how="semi")
    tables = {
        "analysed": analysed,
        "assigned": finished,
        "completed": finished.join(completed, on="participant", how="semi", maintain_order="left"),
        "no_drop": _without(analysed, flagged.filter(pl.col("proposal") == "drop")),
        "no_flag": _without(analysed, flagged.filter(pl.col("proposal") != "keep")),
    }
    people = primary.primary_row(declared, analysed, export).n
    declared = primary.at_this_look(declared, people)  # the same level for all
    if declared.looks:
        return []
    rows = []
    for name, table in tables.items():
        row = primary.primary_row(declared, table, export)
        rows.append(replace(row, section=SECTION, test=name, note=f"{declared.test}: {row.note}"))
    return rows


def _without(episodes: pl.DataFrame, flagged: pl.DataFrame) -> pl.DataFrame:
    """Return the episodes of people who have none of the flagged ones."""
    return episodes.join(flagged.select("participant").unique(), on="participant", how="anti", maintain_order="left")


def attrition_rows(export: Export, analysed: pl.DataFrame, seed: int) -> list[Result]:
    """Return, for `left` (did not finish) and `not_analysed` (any reason), the share of those assigned in each
    condition, and a row that compares the conditions. People who are still taking part are left out. The watched person
    of an analysed round is not lost."""
    settled = export.participants.filter(pl.col("status") != "active")
    people = pl.concat(
        [
            settled.select("condition", "participant", "status"),
            export.withdrawals.select("condition", participant=pl.lit(""), status=pl.lit("withdrawn")),
        ]
    )
    stayed = {
        "left": people.filter(pl.col("status") == "completed"),
        "not_analysed": people.join(_in_analysed(export, analysed), on="participant", how="semi"),
    }
    rows: list[Result] = []
    for test, kept in stayed.items():
        counts = [
            (name, people.filter(pl.col("condition") == name).height, kept.filter(pl.col("condition") == name).height)
            for name in export.conditions
        ]
        counts = [each for each in counts if each[1]]
        for name, assigned, here in counts:
            share = (assigned - here) / assigned
            rows.append(Result(ATTRITION, test, condition=name, estimate=share, n=assigned, unit="people"))
        base = Result(ATTRITION, f"{test}_by_condition", n=sum(each[1] for each in counts), unit="people")
        rows.append(compared(base, [(assigned - here, here) for _, assigned, here in counts], seed))
    return rows


def _in_analysed(export: Export, analysed: pl.DataFrame) -> pl.DataFrame:
    """Return the participants of analysed episodes, with those who were watched in them."""
    rounds = analysed.select(participant="watched_person")
    watched = watched_partners(export, analysed).join(rounds, on="participant", how="semi")
    return pl.concat([analysed.select("participant"), watched.select("participant")])


def compared(base: Result, table: Sequence[tuple[int, int]], seed: int) -> Result:
    """Compare (lost, kept) between conditions: chi-square without correction, or Fisher where people are few."""
    counts = np.array(table)
    if len(table) < 2 or (counts.sum(axis=0) == 0).any():
        why = "only one condition" if len(table) < 2 else "nobody was lost" if counts[:, 0].sum() == 0 else "all were"
        return replace(base, note=why)
    return computed(_compared, base, counts, seed)


def _compared(base: Result, counts: "np.ndarray[tuple[int, int], np.dtype[np.int64]]", seed: int) -> Result:
    test = stats.chi2_contingency(counts, correction=False)
    if test.expected_freq.min() >= MIN_EXPECTED:
        chi2, df, p = (float(value) for value in (test.statistic, test.dof, test.pvalue))
        return replace(base, statistic_name="chi2", statistic=chi2, df=df, p=p, note="chi-square test")
    if len(counts) == 2:
        return replace(base, p=float(stats.fisher_exact(counts).pvalue), note="Fisher’s exact test")
    method = stats.MonteCarloMethod(n_resamples=RESAMPLES, rng=seed)
    p = float(stats.fisher_exact(counts, method=method).pvalue)
    return replace(base, p=p, note=f"Fisher’s test, {RESAMPLES} random tables")
