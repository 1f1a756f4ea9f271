"""`kitchenmind bundle`: pack everything that defines a study into one archive, to register before it begins."""

import argparse
import hashlib
import sys
from pathlib import Path

from server.commands.server_data import ServerData, add_data_options


def add_arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("study", type=Path, metavar="STUDY", help="the study file")
    parser.add_argument("--out", type=Path, metavar="FILE", help="the archive to write; it must not exist (NAME.zip)")
    parser.add_argument(
        "--participants", type=int, metavar="N", help="length of the allocation list (default: the sum of the quotas)"
    )
    parser.add_argument("--plan", type=Path, metavar="FILE", help="a text with your hypotheses and analysis plan")
    add_data_options(
        parser,
        database="the database with the kitchens of the dashboard",
        data="the folder of `kitchenmind serve --data DIR`, with kitchens and trained models",
    )


def run(arguments: argparse.Namespace) -> int:
    """Write the archive and print its hash. Return 2 for wrong input or a study that could not be served."""
    from server.bundle.making import make
    from server.commands.databases import load_stored
    from server.study.loader import StudyError
    from server.study_check import stage_problems

    try:
        if arguments.participants is not None and not 1 <= arguments.participants <= 10_000:
            raise ValueError("--participants is out of range. Give a number from 1 to 10000.")
        file = load_stored(arguments.study, ServerData.of(arguments))
        if errors := [file.describe(problem) for problem in stage_problems(file) if not problem.warning]:
            raise StudyError(errors)
        plan = arguments.plan.read_text(encoding="utf-8") if arguments.plan else ""
        content = make(file, arguments.participants, plan)
        out = arguments.out or Path(f"{file.study.name}.zip")
        with out.open("xb") as archive:
            archive.write(content)
    except FileExistsError:
        sys.stderr.write(f"kitchenmind bundle: {out} already exists. A bundle is never changed: name another file.\n")
        return 2
    except (ValueError, OSError) as error:
        sys.stderr.write(f"kitchenmind bundle: {error}\n")
        return 2
    print(f"{out}\nSHA-256 {hashlib.sha256(content).hexdigest()}")
    print(f"Register both; then `kitchenmind serve --bundle {out}` runs exactly this.")
    return 0
