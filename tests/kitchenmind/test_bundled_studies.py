"""After `pip install`, the commands of the documentation find the studies that they name."""

from argparse import Namespace
from pathlib import Path

import pytest

from kitchenmind.bundled_studies import ROOT, use_bundled_studies
from kitchenmind.command_line import main
from server import settings
from server.commands import study as study_command


@pytest.fixture(autouse=True)
def _empty_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)


def test_a_study_that_comes_with_kitchenmind_is_found_from_any_folder(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["study", "check", "studies/examples/two_factors.yaml"]) == 0
    out, err = capsys.readouterr()
    assert "two_factors.yaml is a study" in out
    assert "using the one that comes with kitchenmind" in err


def test_a_file_that_is_here_is_used_and_other_names_stay_as_they_are(tmp_path: Path) -> None:
    (tmp_path / "studies").mkdir()
    (tmp_path / "studies" / "quick_look.yaml").write_text("mine", encoding="utf-8")
    names = ["studies/quick_look.yaml", "quick_look.yaml", "studies/none.yaml", "studies/../pyproject.toml"]
    given = [*map(Path, names), ROOT / "studies" / "trust.yaml"]
    arguments = Namespace(study=[*given, Path("studies/trust.yaml")], file=Path("quick_look.yaml"), source="studies")
    use_bundled_studies(arguments)
    assert arguments.study == [*given, ROOT / "studies" / "trust.yaml"]
    assert (arguments.file, arguments.source) == (Path("quick_look.yaml"), "studies")


@pytest.mark.parametrize("command", [("serve", "--port", "0", "--study"), ("bots", "1", "--study"), ("study", "check")])
def test_a_study_file_that_is_not_there_is_named_with_the_remedy(
    command: tuple[str, ...], capsys: pytest.CaptureFixture[str]
) -> None:
    assert main([*command, "mine.yaml"]) == 2
    assert "mine.yaml: No such file. Check the path, or make a study file" in capsys.readouterr().err


def test_a_new_study_of_an_installed_kitchenmind_is_written_here(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(settings, "IS_CHECKOUT", False)
    monkeypatch.setattr(study_command, "STUDIES", tmp_path / "packages")
    assert main(["study", "new", "pilot"]) == 0
    assert [path.name for path in tmp_path.iterdir()] == ["pilot.yaml"]
    assert capsys.readouterr().out.startswith("pilot.yaml\n")
