"""Make the report of a study and zip it, in a process that leaves the processor to the games: what the dashboard's
report button starts.

`python -m server.commands.report_archive FOLDER STUDY` writes FOLDER/report.zip and FOLDER/about.json; while it runs,
FOLDER/stage says what it does. The environment names the database: its address may hold a password.
"""

import json
import shutil
import sys
from pathlib import Path

from kitchenmind.argument_parser import ExactArgumentParser
from server.commands import export
from server.commands.export_archive import give_way
from server.monitoring.report_making import ABOUT, ARCHIVE, STAGES, write_stage
from server.monitoring.temporary_folders import end_with_the_server


def main(folder: Path, study: str) -> int:
    """Return the exit status of `kitchenmind export`, or 2 with the reason for data without a report."""
    give_way()
    end_with_the_server(folder)
    parser = ExactArgumentParser()
    export.add_arguments(parser)
    data = folder / study
    words = ["--out", str(data), "--study", study, "--format", "parquet"]
    if status := export.run(parser.parse_args(words)):
        return status
    return _report(folder, data, study)


def _report(folder: Path, data: Path, study: str) -> int:
    write_stage(folder, STAGES[1])
    from analysis.commands.report import WEIGHTS
    from analysis.report import write_analysed
    from analysis.study import Options, analyse
    from analysis.tables import ExportError, read_export

    options = Options(weights=WEIGHTS)
    try:
        analysis = analyse(read_export(data, study), options)
    except ExportError as error:
        print(error, file=sys.stderr)
        return 2
    write_stage(folder, STAGES[2])
    report = write_analysed(analysis, folder / f"{study}-report", options)
    shutil.make_archive(str(folder / ARCHIVE.removesuffix(".zip")), "zip", report.page.parent)
    about = {"participants": analysis.episodes["participant"].n_unique(), "simulated": report.is_simulated}
    (folder / ABOUT).write_text(json.dumps(about), encoding="utf-8")
    return 0


if __name__ == "__main__":
    sys.exit(main(Path(sys.argv[1]), sys.argv[2]))
