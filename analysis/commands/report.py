"""`kitchenmind report`: from an exported study to a page for co-authors."""

import argparse
import sys
from pathlib import Path
from typing import Final

WEIGHTS: Final = Path(__file__).parents[2] / "models" / "weights"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options of the command."""
    parser.add_argument("export", type=Path, metavar="EXPORT_DIR", help="the folder that `kitchenmind export` wrote")
    parser.add_argument("--out", type=Path, default=Path("report"), help="folder to write (default: report)")
    parser.add_argument("--study", help="which study, if the export holds several")
    parser.add_argument(
        "--study-version", type=int, metavar="N", help="which version of the study file (default: all, with a note)"
    )
    parser.add_argument(
        "--questionnaire-layouts",
        nargs="+",
        default=[],
        metavar="LAYOUT",
        help="layouts whose answers are compared (default: the first four)",
    )
    parser.add_argument(
        "--weights",
        type=Path,
        default=WEIGHTS,
        metavar="DIR",
        help="checkpoints whose cards have the offline accuracy (default: the bundled ones)",
    )
    parser.add_argument(
        "--seed", type=int, default=1, help="random seed of permutations, bootstrap and power (default: 1)"
    )


def run(arguments: argparse.Namespace) -> int:
    """Write the report; 2 with a reason for a folder that is not an export."""
    from analysis.changed_files import changed_notice
    from analysis.exclusions import versions_notice
    from analysis.report import write_report
    from analysis.study import Options
    from analysis.tables import ExportError

    layouts = tuple(arguments.questionnaire_layouts)
    options = Options(questionnaire_layouts=layouts, seed=arguments.seed, weights=arguments.weights)
    try:
        if arguments.seed < 0:
            raise ExportError("--seed is negative. Use 0 or more.")
        report = write_report(arguments.export, arguments.out, options, arguments.study, arguments.study_version)
    except ExportError as error:
        print(f"kitchenmind report: {error}", file=sys.stderr)
        return 2
    for notice in (versions_notice(report.analysis.export), changed_notice(arguments.export)):
        if notice:
            print(f"kitchenmind report: {notice}", file=sys.stderr)
    print(f"{report.page}: {report.analysis.episodes.height} episodes analysed, {len(report.analysis.rows)} numbers")
    return 0
