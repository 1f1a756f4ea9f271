"""Export a study and zip it, in a process of low priority: the dashboard's download button starts it.

`python -m server.commands.export_archive FOLDER STUDY`; the environment names the database: its address may hold a
password.
"""

import os
import shutil
import sys
from pathlib import Path

from kitchenmind.argument_parser import ExactArgumentParser
from server.commands import export
from server.monitoring.temporary_folders import end_with_the_server


def main(folder: Path, study: str) -> int:
    """Write `folder`/archive.zip; return the exit status of `kitchenmind export`."""
    give_way()
    end_with_the_server(folder)
    parser = ExactArgumentParser()
    export.add_arguments(parser)
    status = export.run(parser.parse_args(["--out", str(folder / study), "--study", study]))
    if status == 0:
        shutil.make_archive(str(folder / "archive"), "zip", folder, study)
    return status


def give_way() -> None:
    """Run only when the processor is idle, so that no timestep waits for this process (with nice alone, timesteps would
    be some ms late)."""
    os.nice(19)
    if hasattr(os, "SCHED_IDLE"):  # Linux
        os.sched_setscheduler(0, os.SCHED_IDLE, os.sched_param(0))


if __name__ == "__main__":
    sys.exit(main(Path(sys.argv[1]), sys.argv[2]))
