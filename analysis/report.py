"""`kitchenmind report`: an export folder in; one HTML page that can be mailed, figures and results.csv out.

The numbers come from study.py, the sentences from apa_text.py.
"""

import hashlib
import math
import shlex
from collections.abc import Mapping
from dataclasses import dataclass
from datetime import UTC, datetime
from functools import cache
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path

import polars as pl
from jinja2 import Environment, FileSystemLoader, StrictUndefined, select_autoescape
from markupsafe import Markup
from matplotlib.figure import Figure

from analysis import (
    accuracy_text,
    apa_text,
    equivalence_text,
    factorial_text,
    figure_style,
    figures,
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
from analysis.quality_decisions import ANALYSED, with_decisions
from analysis.results import Result, select, write_results
from analysis.sensitivity import populations
from analysis.spreadsheet import safe_table
from analysis.study import Analysis, Options, analyse, smallest_condition
from analysis.table_files import COLUMNS, table_file
from analysis.tables import LAYOUTS, Export, read_export

HERE = Path(__file__).parent


@dataclass(frozen=True)
class Report:
    """What was written."""

    page: Path
    results: Path
    quality: Path
    analysis: Analysis

    @property
    def is_simulated(self) -> bool:
        """Whether it is about bots, or made-up data."""
        return self.analysis.export.is_simulated


def write_report(
    folder: Path, out: Path, options: Options | None = None, study: str | None = None, version: int | None = None
) -> Report:
    """Analyse the export in `folder` and write report.html, results.csv, quality.csv, figures/ and, of a study with
    published scales, scores.csv into `out`, which is made. `study` and `version` choose from what the export holds.
    Raises analysis.tables.ExportError."""
    options = options or Options()
    return write_analysed(analyse(read_export(folder, study, version), options), out, options)


def write_analysed(analysis: Analysis, out: Path, options: Options) -> Report:
    """Write the files of a report whose numbers are computed."""
    out.mkdir(parents=True, exist_ok=True)
    drawn = _draw(analysis, out / "figures")
    report = Report(out / "report.html", out / "results.csv", out / "quality.csv", analysis)
    write_results(analysis.rows, report.results)
    safe_table(_decided(analysis)).write_csv(report.quality)
    if not analysis.scores.is_empty():
        safe_table(analysis.scores).write_csv(out / "scores.csv")
    report.page.write_text(render(analysis, drawn, options), encoding="utf-8")
    return report


def _draw(analysis: Analysis, folder: Path) -> dict[str, str]:
    """Return the figures that the data allow, by name, as SVG for the page; all of them written to `folder`."""
    folder.mkdir(parents=True, exist_ok=True)
    rows, conditions, contrast = analysis.rows, analysis.conditions, analysis.contrast
    made: dict[str, Figure] = {}
    if select(rows, section="reward", test="mean"):
        made["reward"] = figures.rewards(rows, conditions, contrast)
    if contrast and any(not math.isnan(row.effect) for row in _main_tests(analysis)):
        made["effect_sizes"] = figures.effect_sizes(rows, contrast)
    if asked := select(rows, section="questionnaire", test="mean"):
        titles = {row.question: questionnaires.title(row.question) for row in asked}
        made["questionnaire"] = figures.questionnaire(rows, conditions, titles)
    if select(rows, section="accuracy", test="live"):
        made["accuracy"] = figures.accuracy(rows)
    if analysis.powers:
        made["power"] = figures.power(analysis.powers, smallest_condition(analysis.episodes, conditions))
    if analysis.model.residuals.size:
        made["residuals"] = figures.quantiles(analysis.model.residuals)
    simulated = analysis.export.is_simulated
    return {name: figure_style.save(figure, folder, name, simulated) for name, figure in made.items()}


def _main_tests(analysis: Analysis) -> list[Result]:
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
    """Return the whole page as one HTML text that needs no network."""

    def rows(**wanted: object) -> list[Result]:
        return select(analysis.rows, **wanted)

    return (
        _environment()
        .get_template("report.html.j2")
        .render(
            a=analysis,
            rows=rows,
            main_tests=_main_tests(analysis),
            questionnaire_rows=_asked(analysis),
            repeated=repeats(analysis.episodes),
            draws=options.draws,
            versions=versions_notice(analysis.export),
            changed=changed_notice(analysis.export.folder),
            models=models_notice(analysis.export),
            figures={name: Markup(svg) for name, svg in drawn.items()},  # noqa: S704
            css=Markup((HERE / "report.css").read_text(encoding="utf-8")),  # noqa: S704
            script=Markup((HERE / "report.js").read_text(encoding="utf-8")),  # noqa: S704
            within=analysis.within,
            adjusted=ADJUSTED,
            adjusted_why=WHY,
            primary=[Markup(text) for text in _primary(analysis)],  # noqa: S704
            findings=[Markup(text) for text in apa_text.findings(analysis)],  # noqa: S704
            sentences=[Markup(text) for text in _sentences(analysis)],  # noqa: S704
            flagged=_flagged(analysis),
            faster=faster_than_real_time(analysis.export.ticks).height,
            populations=populations(analysis.subjects),
            checks=robustness_text.checks(analysis.subjects),
            equivalence=equivalence_text.pairs_of_rows(analysis.rows),
            own_grids=[name for name in analysis.layouts if name in LAYOUTS[1:]],
            provenance=_provenance(analysis, options),
            simulated=analysis.export.is_simulated,
            who=analysis.subjects,
            left_out=analysis.export.simulated_left_out,
            displays=_displays(analysis.export),
        )
    )


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


def _primary(analysis: Analysis) -> list[str]:
    return primary_text.primary_lines(analysis.declaration, analysis.rows, analysis.subjects)


def _decided(analysis: Analysis) -> pl.DataFrame:
    return with_decisions(analysis.quality, analysis.export.participants, analysis.episodes)


def _flagged(analysis: Analysis) -> pl.DataFrame:
    """Return the episodes that a rule flagged or that were not analysed, the worst first."""
    wanting = (pl.col("proposal") != "keep") | (pl.col("decision") != ANALYSED)
    order = pl.col("proposal").replace_strict(["drop", "look", "keep"], [0, 1, 2])
    return _decided(analysis).filter(wanting).sort(order, maintain_order=True)


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


def _provenance(analysis: Analysis, options: Options) -> dict[str, str]:
    export = analysis.export
    people = analysis.episodes.unique("participant")["condition"]
    arms = [f"{int((people == name).sum())} {formatting.condition_title(name)}" for name in analysis.conditions]
    flow = {row.test: row.n for row in select(analysis.rows, section="exclusions", condition="all", unit="episodes")}
    return {
        "Data set": f"sha256 {fingerprint(export.folder)[:32]}…",
        export.subjects.participants.capitalize(): f"{people.len()} analysed"
        + (f": {', '.join(arms)}" if arms else ""),
        "Study": str(export.about.get("title") or export.study),
        "Study version": _version(export),
        "Episodes": f"{flow.get('played', 0)} played, {flow.get('analysed', 0)} analysed",
        "Software": _software(export),
        "Seed": str(options.seed),
        "Make it again": _command(export, options),
        "Made": f"{datetime.now(UTC):%d %B %Y, %H:%M} UTC",
    }


def _version(export: Export) -> str:
    if export.version is not None:
        return f"{export.version} alone"
    return ", ".join(str(version) for version in export.versions) or "not recorded"


def _command(export: Export, options: Options) -> str:
    """Return the command that makes the same report."""
    words = ["kitchenmind", "report", export.folder.name, "--study", export.study]
    words += ["--study-version", str(export.version)] if export.version is not None else []
    chosen = options.questionnaire_layouts
    words += ["--questionnaire-layouts", *chosen] if chosen else []
    return shlex.join([*words, "--seed", str(options.seed)])


def _software(export: Export) -> str:
    """Return the version that made this page, and those that the games were played on."""
    try:
        here = f"kitchenmind {version('kitchenmind')}"
    except PackageNotFoundError:
        here = "kitchenmind"
    if "code_version" not in export.episodes.columns:
        return here
    played = ", ".join(sorted(str(name) for name in export.episodes["code_version"].drop_nulls().unique()))
    return f"{here}; played on {played}"


def fingerprint(folder: Path) -> str:
    """Return the SHA-256 of the tables that were read, in the order of their names: equal data give equal
    fingerprints."""
    digest = hashlib.sha256()
    for name in sorted(COLUMNS):
        path = table_file(folder, name)
        if path is not None:
            digest.update(hashlib.sha256(path.read_bytes()).digest())
    return digest.hexdigest()
