"""`--data DIR` names the same database, kitchens and models for every command as for `kitchenmind serve`."""

import argparse
import importlib
import shutil
from collections.abc import Iterator
from pathlib import Path

import pytest

import kitchenmind
from kitchenmind.argument_parser import ExactArgumentParser
from server.bundle.archive import BundleRefused
from server.commands import bots, serve
from server.commands.server_data import ServerData
from server.store import kitchens
from server.store.database import Database
from tests.server.participation.test_own_models import GRID, MINE, RING
from tests.support.databases import with_tables


def parser_of(verb: str) -> ExactArgumentParser:
    parser = ExactArgumentParser(prog=f"kitchenmind {verb}")
    importlib.import_module(kitchenmind.VERBS[verb][0]).add_arguments(parser)
    return parser


def commands(parser: argparse.ArgumentParser) -> Iterator[argparse.ArgumentParser]:
    """The parser and those of its own commands."""
    yield parser
    for action in parser._actions:
        if isinstance(action, argparse._SubParsersAction):
            for inner in action.choices.values():
                yield from commands(inner)


@pytest.fixture
def data(tmp_path: Path) -> Path:
    """The folder of a server with a kitchen and a trained agent; and a study file that names both."""
    folder = tmp_path / "lab data"
    shutil.copytree(RING / "sp", folder / "models" / "nook" / "mine")
    shutil.copytree(RING / "sp_predictor_stream", folder / "models" / "nook" / "mine_predictor_stream")
    with Database(with_tables(folder / "kitchenmind.sqlite3")) as database:
        database.write_now(kitchens.save, "nook", GRID, "mara", 0)
    grid = MINE[MINE.index("    grid: |\n") : MINE.index("XXXPX")]
    rows = "".join(f"      {row}\n" for row in GRID.splitlines())
    assert grid + rows[6:] in MINE
    (tmp_path / "study.yaml").write_text(MINE.replace(grid + rows[6:], ""), encoding="utf-8")
    return folder


def test_every_command_that_takes_a_database_takes_the_folder_of_a_server() -> None:
    taking = []
    for verb in kitchenmind.VERBS:
        for parser in commands(parser_of(verb)):
            options = parser._option_string_actions
            assert ("--data" in options) == ("--database" in options), parser.prog
            taking += [parser.prog] if "--data" in options else []
    assert len(taking) >= 15


def test_the_folder_means_the_database_that_serve_uses(data: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    words = ["--data", str(data)]
    served = serve.settings_of(parser_of("serve").parse_args(words))
    assert served.data_option == f" --data '{data}'"
    assert ServerData.of(parser_of("verify").parse_args(words)).url == served.database
    assert kitchenmind.main(["verify", *words]) == 0
    elsewhere = "postgresql://lab@db/kitchenmind"
    monkeypatch.setenv("KITCHENMIND_DATABASE", elsewhere)
    served = serve.settings_of(parser_of("serve").parse_args(words))
    assert ServerData.of(parser_of("verify").parse_args(words)).url == served.database == elsewhere


def test_a_server_with_a_folder_and_another_database_is_named_by_both_options() -> None:
    words = ["--data", "lab", "--database", "postgresql://lab@db/kitchenmind"]
    served, named = serve.settings_of(parser_of("serve").parse_args(words)), parser_of("verify").parse_args(words)
    assert ServerData.of(named).url == served.database == words[3]
    assert ServerData.of(named).own_models == served.own_models


def test_an_import_names_its_new_database(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert kitchenmind.main(["import", str(tmp_path)]) == 2
    assert "name the new database with --data DIR or --database URL." in capsys.readouterr().err


def test_kitchens_and_models_of_the_folder_are_found(
    data: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    study = tmp_path / "study.yaml"
    assert kitchenmind.main(["study", "check", str(study), "--data", str(tmp_path / "empty")]) == 2
    capsys.readouterr()
    assert kitchenmind.main(["study", "check", str(study), "--data", str(data)]) == 0, capsys.readouterr().err
    (tmp_path / "own").mkdir()
    _, environment = bots._with_kitchens(study, tmp_path / "own", data)
    assert environment["KITCHENMIND_DATA"] == str(data)


def test_a_bundle_is_served_with_the_models_of_the_folder(data: Path, tmp_path: Path) -> None:
    archive = tmp_path / "study.zip"
    assert kitchenmind.main(["bundle", str(tmp_path / "study.yaml"), "--out", str(archive), "--data", str(data)]) == 0
    parser = parser_of("serve")
    with serve.unbundled(parser.parse_args(["--bundle", str(archive), "--data", str(data)])):
        pass
    with pytest.raises(BundleRefused), serve.unbundled(parser.parse_args(["--bundle", str(archive)])):
        pass
