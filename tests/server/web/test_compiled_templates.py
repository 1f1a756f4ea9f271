"""Compiled templates are kept for the next process, if the folder of compiled code can be written."""

from pathlib import Path
from typing import Any

import jinja2
import pytest

from server.web import compiled_templates, dependencies

PAGE = "participant/error.html"


@pytest.fixture
def compiled(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> list[Any]:
    """The templates that were compiled; `tmp_path` is the folder of compiled code."""
    found: list[Any] = []
    original = jinja2.Environment._compile

    def counted(environment: jinja2.Environment, source: str, filename: str) -> Any:
        found.append(filename)
        return original(environment, source, filename)

    monkeypatch.setattr(jinja2.Environment, "_compile", counted)
    monkeypatch.setattr("sys.dont_write_bytecode", False)
    monkeypatch.setattr(compiled_templates, "FOLDER", tmp_path)
    return found


def load_in_a_new_process() -> jinja2.Template:
    return dependencies.templates.__wrapped__().get_template(PAGE)


def test_the_next_process_does_not_compile_templates_again(compiled: list[Any]) -> None:
    load_in_a_new_process()
    assert len(compiled) == 1
    load_in_a_new_process()
    assert len(compiled) == 1


def test_code_of_another_version_of_jinja_is_compiled_again(
    compiled: list[Any], monkeypatch: pytest.MonkeyPatch
) -> None:
    load_in_a_new_process()
    monkeypatch.setattr(compiled_templates, "_HEAD", b"another ")
    load_in_a_new_process()
    assert len(compiled) == 2


def test_a_damaged_file_is_compiled_again(compiled: list[Any], tmp_path: Path) -> None:
    load_in_a_new_process()
    (kept,) = tmp_path.iterdir()
    kept.write_bytes(kept.read_bytes()[:-100])
    load_in_a_new_process()
    assert len(compiled) == 2


def test_without_a_folder_for_compiled_code_templates_work(compiled: list[Any], tmp_path: Path) -> None:
    tmp_path.rmdir()
    load_in_a_new_process()
    assert not tmp_path.exists()
    tmp_path.mkdir()


def test_with_a_full_disk_templates_work(compiled: list[Any], tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def full(*_: Any) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(Path, "write_bytes", full)
    load_in_a_new_process()
    assert list(tmp_path.iterdir()) == []
