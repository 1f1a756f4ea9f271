"""The page of a report: the template filled with an analysis, its sentences and its figures."""

import math
from collections.abc import Mapping
from functools import cache
from pathlib import Path

import polars as pl
from jinja2 import Environment, FileSystemLoader, StrictUndefined, select_autoescape
from markupsafe import Markup

from analysis import (
    accuracy_text,
    apa_text,
    equivalence_text,
    factorial_text,
    formatting,
    primary_text,
    questionnaires,
    robustness_text,
    scales,
    sensitivity_text,
)
from analysis.accuracy import degraded_to
from analysis.block_orders import ADJUSTED, WHY
from analysis.changed_files import changed_notice
from analysis.changed_models import models_notice
from analysis.compare import repeats
from analysis.exclusions import versions_notice
from analysis.key_lag import faster_than_real_time
from analysis.provenance import provenance
from analysis.quality_decisions import ANALYSED, with_decisions
from analysis.results import Result, select
from analysis.sensitivity import populations
from analysis.study import Analysis, Options
from analysis.tables import LAYOUTS, Export

HERE = Path(__file__).parent


@cache
def _environment() -> Environment:
    """Return the template's environment: every value is escaped, numbers and names are written as in a paper."""
    environment = Environment(
        loader=FileSystemLoader(HERE),
        autoescape=select_autoescape(["html", "j2"]),
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    environment.filters.update(
        number=formatting.number,
        signed=formatting.signed,
        degrees=formatting.degrees,
        p=formatting.p_value,
        p_equals=formatting.p_equals,
        layout=formatting.layout_title,
        agent=formatting.agent_title,
        condition=formatting.condition_title,
        contrast=formatting.contrast_title,
        question=questionnaires.title,
        effect=factorial_text.effect_title,
        scale=scales.scale_title,
    )
    environment.globals["outcome"] = equivalence_text.outcome
    environment.globals["accuracy_lines"] = accuracy_text.accuracy_lines
    environment.tests["degraded"] = lambda predictor: degraded_to(predictor) is not None
    environment.tests["computed"] = lambda value: not math.isnan(value)
    return environment


def render(analysis: Analysis, drawn: Mapping[str, str], options: Options) -> str:
    """Return the whole page as one HTML text that needs no network. `drawn`: SVG of each figure, by name."""
    template = _environment().get_template("report.html.j2")
    return template.render(
        a=analysis,
        within=analysis.within,
        who=analysis.subjects,
        css=Markup((HERE / "report.css").read_text(encoding="utf-8")),  # noqa: S704
        script=Markup((HERE / "report.js").read_text(encoding="utf-8")),  # noqa: S704
        figures={name: Markup(svg) for name, svg in drawn.items()},  # noqa: S704
        provenance=provenance(analysis, options),
        draws=options.draws,
        **_texts(analysis),
        **_tables(analysis),
        **_notices(analysis.export),
    )


def _texts(analysis: Analysis) -> dict[str, object]:
    """Return the sentences, in which everything that comes from the study is escaped."""
    primary = primary_text.primary_lines(analysis.declaration, analysis.rows, analysis.subjects)
    return {
        "primary": [Markup(text) for text in primary],  # noqa: S704
        "findings": [Markup(text) for text in apa_text.findings(analysis)],  # noqa: S704
        "sentences": [Markup(text) for text in _sentences(analysis)],  # noqa: S704
        "populations": populations(analysis.subjects),
        "checks": robustness_text.checks(analysis.subjects),
        "adjusted": ADJUSTED,
        "adjusted_why": WHY,
    }


def _tables(analysis: Analysis) -> dict[str, object]:
    """Return what the page shows as tables, and `rows`, which chooses result rows by their columns."""

    def rows(**wanted: object) -> list[Result]:
        return select(analysis.rows, **wanted)

    return {
        "rows": rows,
        "main_tests": main_tests(analysis),
        "questionnaire_rows": _asked(analysis),
        "repeated": repeats(analysis.episodes),
        "flagged": _flagged(analysis),
        "equivalence": equivalence_text.pairs_of_rows(analysis.rows),
        "own_grids": [name for name in analysis.layouts if name in LAYOUTS[1:]],
    }


def _notices(export: Export) -> dict[str, object]:
    """Return what a reader should know of the data before their numbers."""
    return {
        "versions": versions_notice(export),
        "changed": changed_notice(export.folder),
        "models": models_notice(export),
        "faster": faster_than_real_time(export.ticks).height,
        "simulated": export.is_simulated,
        "left_out": export.simulated_left_out,
        "displays": _displays(export),
    }


def _sentences(analysis: Analysis) -> list[str]:
    """Return the primary test first, then everything else."""
    who = analysis.subjects
    first = primary_text.primary_sentence(analysis.declaration, analysis.rows, who)
    return [
        *([first] if first else []),
        *factorial_text.factorial_sentences(analysis.rows, who),
        *apa_text.sentences(analysis),
        *equivalence_text.equivalence_sentences(analysis.rows, who),
        *sensitivity_text.sensitivity_sentences(analysis.declaration, analysis.contrast, analysis.rows, who),
        *robustness_text.check_sentences(analysis.contrast, analysis.rows, who),
    ]


def main_tests(analysis: Analysis) -> list[Result]:
    """Return the tests of reward over people, between the two conditions of the main contrast."""
    contrast = " - ".join(analysis.contrast or ())
    return select(analysis.rows, section="reward", test="t_test_people", contrast=contrast)


def _asked(analysis: Analysis) -> list[Result]:
    """Return one of the questionnaire's tests for each question and comparison, in reporting order."""
    tests = select(analysis.rows, section="questionnaire", test="t_test_people")
    first: dict[tuple[str, str], Result] = {}
    for row in tests:
        first.setdefault((row.question, row.contrast), row)
    order = list(dict.fromkeys(row.question for row in tests))
    return sorted(first.values(), key=lambda row: order.index(row.question))


def _flagged(analysis: Analysis) -> pl.DataFrame:
    """Return the episodes that a rule flagged or that were not analysed, the worst first."""
    wanting = (pl.col("proposal") != "keep") | (pl.col("decision") != ANALYSED)
    order = pl.col("proposal").replace_strict(["drop", "look", "keep"], [0, 1, 2])
    return decided(analysis).filter(wanting).sort(order, maintain_order=True)


def decided(analysis: Analysis) -> pl.DataFrame:
    """Return the quality of each episode with what was decided about it."""
    return with_decisions(analysis.quality, analysis.export.participants, analysis.episodes)


def _displays(export: Export) -> list[tuple[str, int, int | None, int, int]]:
    """Return by condition: timesteps that did not show what the condition requires, those of them in which the server
    was late (None: an older export), episodes that have any, all episodes."""
    found = []
    for condition in export.conditions:
        episodes = export.episodes.filter(pl.col("condition") == condition)
        counts, late = (episodes[name].drop_nulls() for name in ("display_violations", "display_violations_late"))
        known = int(late.sum()) if late.len() else None
        found.append((condition, int(counts.sum()), known, int((counts > 0).sum()), counts.len()))
    return found if any(row[1] for row in found) else []
