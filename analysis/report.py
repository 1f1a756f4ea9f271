"""`kitchenmind report`: an export folder in; one HTML page that can be mailed, figures and results.csv out.

The numbers come from study.py, the page from report_page.py, its sentences from apa_text.py and others.
"""

import math
from dataclasses import dataclass
from pathlib import Path

from matplotlib.figure import Figure

from analysis import (
    figure_style,
    figures,
    questionnaires,
)
from analysis.report_page import decided, main_tests, render
from analysis.results import select, write_results
from analysis.spreadsheet import safe_table
from analysis.study import Analysis, Options, analyse, smallest_condition
from analysis.tables import read_export


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
    safe_table(decided(analysis)).write_csv(report.quality)
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
    if contrast and any(not math.isnan(row.effect) for row in main_tests(analysis)):
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
