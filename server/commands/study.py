"""`kitchenmind study`: create a study file, check one, print the schema that editors use, list kept models, delete
a study's data."""

import argparse
import json
import os
import re
import secrets
import sys
from pathlib import Path
from typing import TYPE_CHECKING

from server.commands import delete_study, kept_models
from server.commands.server_data import ServerData, add_data_options

if TYPE_CHECKING:
    from server.study.definition import Study
    from server.study.loader import StudyFile

STUDIES = Path(__file__).parents[2] / "studies"
PATTERN = STUDIES / "quick_look.yaml"
SCHEMA = STUDIES / "schema.json"
MAX_PLACES, WIDTH = 20, 22


def add_arguments(parser: argparse.ArgumentParser) -> None:
    verbs = parser.add_subparsers(dest="study_verb", required=True, metavar="new|check|schema|words|models|delete")
    new = verbs.add_parser("new", help="create a study file that is ready to serve")
    new.add_argument("name", help="the study's name in its address and data, such as pilot_1")
    new.add_argument("--out", type=Path, help="the file to write (NAME.yaml here; in a checkout, studies/NAME.yaml)")
    check = verbs.add_parser("check", help="list every mistake in a file: line, reason, fix")
    check.add_argument("file", type=Path, help="the study file")
    add_data_options(
        check,
        database="the database with the kitchens of the dashboard",
        data="the folder of `kitchenmind serve --data DIR`, with kitchens and trained models",
    )
    verbs.add_parser("schema", help="print the JSON Schema of study files, for editors")
    words = verbs.add_parser("words", help="write the platform's words for translation, or list what is missing")
    words.add_argument("language", help="the language's code, such as de or pt-BR")
    words.add_argument(
        "place", type=Path, nargs="?", default=Path(), metavar="STUDY", help="a study file or its folder (here)"
    )
    kept_models.add_arguments(
        verbs.add_parser("models", help="list the copies of trained models that versions keep, or delete unused ones")
    )
    delete_study.add_arguments(
        verbs.add_parser("delete", help="delete all data of a study, such as at the end of its retention period")
    )


def run(arguments: argparse.Namespace) -> int:
    """Return 0 if done, 2 if the name or the file is wrong."""
    if arguments.study_verb == "new":
        return _new(arguments.name, arguments.out or _folder_for_new() / f"{arguments.name}.yaml")
    if arguments.study_verb == "words":
        return _words(arguments.language, arguments.place)
    if arguments.study_verb == "models":
        return kept_models.run(arguments)
    if arguments.study_verb == "delete":
        return delete_study.run(arguments)
    return _check(arguments.file, arguments) if arguments.study_verb == "check" else _schema()


def _folder_for_new() -> Path:
    """Return the folder for new files: never the one in which packages are installed."""
    from server.settings import IS_CHECKOUT

    return STUDIES if IS_CHECKOUT else Path()


def _new(name: str, path: Path) -> int:
    if not re.fullmatch(r"[a-z][a-z0-9_-]{0,39}", name):
        return _refuse(f"{name!r} cannot name a study. Use lowercase letters, digits, - and _, a letter first.")
    if path.exists():
        return _refuse(f"{path} already exists. Choose another name, or --out FILE.")
    head = f"# yaml-language-server: $schema={os.path.relpath(SCHEMA, path.parent.resolve())}\n# The study {name}.\n"
    text = re.sub(r"\A(#.*\n)+", head, PATTERN.read_text("utf-8"))
    text = re.sub(r"(?m)^name: .*$", f"name: {name}", text)
    text = re.sub(r"(?m)^seed: .*$", f"seed: {secrets.randbelow(10**9)}", text)
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(text, encoding="utf-8")
    print(f"{path}\nNext: edit it, `kitchenmind study check {path}`, `kitchenmind serve --study {path}`.")
    return 0


def _check(path: Path, arguments: argparse.Namespace) -> int:
    from server.commands.databases import load_stored
    from server.prediction_warnings import prediction_warnings
    from server.study.loader import StudyError
    from server.study_check import stage_problems

    try:
        file = load_stored(path, ServerData.of(arguments))
    except StudyError as error:
        return _refuse(*error.lines)
    except (ValueError, FileNotFoundError) as error:
        return _refuse(f"kitchenmind study: {error}")
    except OSError as error:
        return _refuse(f"{path}: {error.strerror}. Give the path of a study file.")
    found = list(stage_problems(file))
    for line in (*file.warnings, *(file.describe(problem) for problem in found if problem.warning)):
        print(f"warning: {line}")
    if all(problem.warning for problem in found):
        for problem in prediction_warnings(file):
            print(f"warning: {file.describe(problem)}")
    errors = [file.describe(problem) for problem in found if not problem.warning]
    if errors:
        return _refuse(*errors)
    print(_summary(file))
    return 0


def _summary(file: "StudyFile") -> str:
    from server.study.steps import episodes_of, steps

    study = file.study
    conditions = ", ".join(f"{one.name} x{one.weight}" for one in study.conditions)
    pages = len(steps(study, study.conditions[0].name, study.seed))
    episodes, languages = episodes_of(study), ", ".join(study.languages)
    factors = "; ".join(f"{name}: {', '.join(levels)}" for name, levels in study.factors.items())
    lines = [
        f"{file.source} is a study: {study.name}, version {file.sha256[:12]}",
        *([f"  factors      {factors}"] if factors else []),
        f"  conditions   {conditions}",
        *_blocks(study),
        f"  steps        {pages}, with {episodes} episode{'s' * (episodes != 1)}; languages {languages}",
        f"  primary      {_primary(study)}",
        f"  order        {study.order.rule}; how many of 60 simulated participants meet what in which episode:",
        *_balance(file, min(episodes, MAX_PLACES)),
    ]
    return "\n".join(lines)


def _blocks(study: "Study") -> list[str]:
    """Return what is shown in which block, if factors vary within people."""
    if study.blocks == 1:
        return []
    orders = (f"{one.name}: {', '.join(seen.name for seen in one.displays)}" for one in study.conditions)
    return [f"  blocks       {'; '.join(orders)}"]


def _primary(study: "Study") -> str:
    """Describe the declared primary test, or say that there is none."""
    primary = study.primary
    if primary is None:
        return "no primary test is declared; `primary:` declares one before data collection"
    what = f"effect of {' x '.join(primary.effect)}" if primary.effect else " - ".join(primary.comparison)
    words = f"{primary.test} of {primary.measure}, {what}, {primary.direction}"
    looks = f", looks at {', '.join(map(str, primary.looks))} people ({primary.spending})" if primary.looks else ""
    return f"{words}, alpha {primary.alpha:g}{looks}"


def _balance(file: "StudyFile", places: int) -> list[str]:
    """Return a row for each layout and agent, a column for each episode."""
    from server.study.checks import balance

    lines = ["    " + " " * WIDTH + "".join(f"{place + 1:>4}" for place in range(places))] if places else []
    for counts in balance(file.study).values():
        for name in dict.fromkeys(name for name, _ in counts):
            row = "".join(f"{counts[name, place]:>4}" for place in range(places))
            lines.append(f"    {name[:WIDTH]:<{WIDTH}}{row}")
    return lines


def _schema() -> int:
    from server.study.schema import study_schema

    print(json.dumps(study_schema(), indent=2, ensure_ascii=False))
    return 0


def _words(language: str, place: Path) -> int:
    """Write the file of a language next to a study. An existing file is not changed: missing texts are listed."""
    from server.study import own_languages
    from server.study.locale import is_bundled

    if not own_languages.LANGUAGE.fullmatch(language):
        return _refuse(f"{language!r} is not the code of a language. Use one such as de or pt-BR.")
    if is_bundled(language):
        return _refuse(f"The platform already has words in {language!r}. Use another language.")
    if not place.exists():
        return _refuse(f"{place} does not exist. Give a study file or its folder.")
    path = own_languages.language_file(place if place.is_dir() else place.parent, language)
    try:
        if not path.exists():
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_text(own_languages.template(language), encoding="utf-8")
            print(f"{path}\nNext: translate it, add {language!r} to the study's `languages` and texts, run this again.")
            return 0
        found = own_languages.completeness(path)
    except own_languages.LanguageError as error:
        return _refuse(*error.lines)
    except OSError as error:
        return _refuse(f"{path}: {error.strerror}. Give a study file or a folder in which you can write.")
    print(f"{path}: {len(found.missing)} missing, shown in English; {len(found.obsolete)} obsolete, not used")
    for key, english in found.missing.items():
        print(f"  missing   {key}: {english}")
    for key in found.obsolete:
        print(f"  obsolete  {key}")
    return 0


def _refuse(*lines: str) -> int:
    print("\n".join(lines), file=sys.stderr)
    return 2
