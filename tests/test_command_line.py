"""The command line: quick, complete, and clear about wrong input."""

import argparse
import importlib
import os
import re
import subprocess
import sys
from importlib.metadata import version
from pathlib import Path
from types import SimpleNamespace

import pytest

import kitchenmind
from kitchenmind import extras
from server.commands import admin

ROOT = Path(__file__).parent.parent


def test_help_names_every_verb_and_imports_nothing_heavy() -> None:
    program = "import sys, kitchenmind\ntry: kitchenmind.main(['--help'])\nfinally: print(sorted(sys.modules))"
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, cwd=ROOT)
    shown, _, loaded = done.stdout.rpartition("['")
    assert set(re.findall(r"^    (\w+)\b", shown, re.MULTILINE)) == set(kitchenmind.VERBS)
    assert not [name for name in ("numpy", "numba", "torch", "fastapi", "sqlalchemy") if f"'{name}'" in loaded]


def test_the_version_is_that_of_the_installed_package(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as leaving:
        kitchenmind.main(["--version"])
    assert leaving.value.code == 0
    assert capsys.readouterr().out == f"kitchenmind {version('kitchenmind')}\n"


def test_a_command_leaves_its_objects_out_of_the_last_collection() -> None:
    told = "import atexit, gc, sys, kitchenmind\natexit.register(lambda: print(gc.get_freeze_count() > 0))\n"
    command = "sys.argv[1:] = ['--help']\nkitchenmind.main()"
    done = subprocess.run([sys.executable, "-c", told + command], capture_output=True, text=True, cwd=ROOT)
    assert done.stdout.split()[-1] == "True"


@pytest.mark.parametrize("verb", kitchenmind.VERBS)
def test_the_verb_exists_and_has_a_help_text(verb: str, capsys: pytest.CaptureFixture[str]) -> None:
    module = importlib.import_module(kitchenmind.VERBS[verb][0])
    assert callable(module.run)
    with pytest.raises(SystemExit) as leaving:
        kitchenmind.main([verb, "--help"])
    assert leaving.value.code == 0
    assert f"kitchenmind {verb}" in capsys.readouterr().out


@pytest.mark.parametrize("words", [["study", "check", "studies/quick_look.yaml"], ["study", "schema"]])
def test_output_that_nobody_reads_ends_the_command_without_a_traceback(words: list[str]) -> None:
    reader, writer = os.pipe()
    os.close(reader)  # as `| head -0`
    done = subprocess.run(
        [sys.executable, ROOT / "kitchenmind", *words], stdout=writer, stderr=subprocess.PIPE, text=True, cwd=ROOT
    )
    os.close(writer)
    assert (done.returncode, done.stderr) == (141, "")


@pytest.mark.parametrize("words", [[], ["bake"], ["replay"], ["replay", "a", "--unknown"]])
def test_wrong_words_give_exit_status_2_and_a_usage(words: list[str], capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as leaving:
        kitchenmind.main(words)
    assert leaving.value.code == 2
    assert "usage: kitchenmind" in capsys.readouterr().err


@pytest.mark.parametrize(
    "words", [["verify", "--databas", "sqlite:///x.db"], ["admin", "list", "--dat", "x"], ["serve", "--hos", "::1"]]
)
def test_options_are_known_by_their_full_names_only(words: list[str], capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as leaving:
        kitchenmind.main(words)
    assert leaving.value.code == 2
    assert f"unrecognized arguments: {words[-2]} {words[-1]}" in capsys.readouterr().err


def test_no_program_of_this_project_accepts_abbreviated_options() -> None:
    """A subclass outside of tests, or the argument itself."""
    listed = subprocess.run(["git", "grep", "-lw", "ArgumentParser", "*.py"], cwd=ROOT, capture_output=True, text=True)
    programs = [ROOT / name for name in listed.stdout.split() if not name.startswith("tests/")]
    assert len(programs) >= 20
    calls = [
        (program.name, call)
        for program in programs
        for call in re.findall(r"argparse\.ArgumentParser\(\s*([^)]*)", program.read_text("utf-8"))
    ]
    assert [call for call in calls if "allow_abbrev=False" not in call[1]] == []


def test_missing_package_is_named_with_its_remedy(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    (tmp_path / "needing_a_package.py").write_text("import a_package_that_nobody_installed")
    monkeypatch.syspath_prepend(str(tmp_path))
    monkeypatch.setitem(kitchenmind.VERBS, "bake", ("needing_a_package", "bakes"))
    assert kitchenmind.main(["bake"]) == 2
    message = capsys.readouterr().err
    assert "a_package_that_nobody_installed" in message
    assert "make setup" in message


def test_outside_a_checkout_the_remedy_names_only_what_the_verb_needs(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    (tmp_path / "analysis").mkdir()
    (tmp_path / "server").mkdir()
    monkeypatch.setattr(extras, "ROOT", tmp_path)
    for module, extra in (("analysis.needing", "kitchenmind[analysis]"), ("server.needing", "kitchenmind")):
        monkeypatch.setitem(kitchenmind.VERBS, "bake", (module, "bakes"))
        monkeypatch.setitem(sys.modules, module, SimpleNamespace(add_arguments=_needs_a_package))
        assert kitchenmind.main(["bake"]) == 2
        assert f"run `pip install '{extra}'`" in capsys.readouterr().err


def _needs_a_package(_parser: object) -> None:
    raise ModuleNotFoundError(name="a_package_that_nobody_installed")


@pytest.mark.parametrize(
    "words",
    [
        ["--database", "sqlite:///one.db", "create", "anna"],
        ["create", "anna", "--database", "sqlite:///one.db"],
        ["list", "--database", "sqlite:///one.db"],
    ],
)
def test_admin_takes_the_database_before_and_after_its_verb(words: list[str]) -> None:
    parser = argparse.ArgumentParser()
    admin.add_arguments(parser)
    assert parser.parse_args(words).database == "sqlite:///one.db"
    assert parser.parse_args(["list"]).database is None
