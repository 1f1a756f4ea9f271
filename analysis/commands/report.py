"""`kitchenmind report`: from an exported study to a page for co-authors."""

import argparse
import sys
from pathlib import Path


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declares what the verb takes."""
    parser.add_argument("export", type=Path, metavar="EXPORT_DIR", help="the folder that `kitchenmind export` wrote")
    parser.add_argument("--out", type=Path, default=Path("report"), help="folder to write into (default: report)")
    parser.add_argument("--study", help="which study, where the export holds several")
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
        default=Path(__file__).parents[2] / "models" / "weights",
        metavar="DIR",
        help="checkpoints whose cards tell the offline accuracy (default: the shipped ones)",
    )
    parser.add_argument("--seed", type=int, default=1, help="of the simulated power curve (default: 1)")


def run(arguments: argparse.Namespace) -> int:
    """Writes the report; 2 with a reason for a folder that is no export."""
    from analysis.report import write_report
    from analysis.study import Options
    from analysis.tables import ExportError

    layouts = tuple(arguments.questionnaire_layouts)
    options = Options(questionnaire_layouts=layouts, seed=arguments.seed, weights=arguments.weights)
    try:
        report = write_report(arguments.export, arguments.out, options, arguments.study)
    except ExportError as error:
        print(f"kitchenmind report: {error}", file=sys.stderr)
        return 2
    print(f"{report.page}: {report.analysis.episodes.height} episodes analysed, {len(report.analysis.rows)} numbers")
    return 0
