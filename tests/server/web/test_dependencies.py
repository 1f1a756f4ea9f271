"""Compiled templates are kept for the next process, if the folder of compiled code can be written."""

from pathlib import Path
from typing import Any

import jinja2
import pytest

from server.web import dependencies

PAGE = "participant/error.html"


def environment_of_a_new_process() -> jinja2.Environment:
    return dependencies.templates.__wrapped__()


def test_the_next_process_does_not_compile_templates_again(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    compiled: list[Any] = []
    original = jinja2.Environment._compile

    def counted(environment: jinja2.Environment, source: str, filename: str) -> Any:
        compiled.append(filename)
        return original(environment, source, filename)

    monkeypatch.setattr(jinja2.Environment, "_compile", counted)
    monkeypatch.setattr(dependencies.sys, "dont_write_bytecode", False)
    monkeypatch.setattr(dependencies, "_COMPILED", tmp_path)
    environment_of_a_new_process().get_template(PAGE)
    assert len(compiled) == 1
    environment_of_a_new_process().get_template(PAGE)
    assert len(compiled) == 1


def test_without_a_folder_for_compiled_code_templates_work(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(dependencies, "_COMPILED", tmp_path / "none")
    environment_of_a_new_process().get_template(PAGE)
    assert list(tmp_path.iterdir()) == []
