"""The generated pages of docs/reference are those that the code gives now, and leave nothing out."""

import re
from pathlib import Path

import pytest

from docs.generate import DATA, PAGES, REFERENCE
from server.settings import Settings
from server.study.definition import Study
from server.study.sections import SECTIONS


@pytest.mark.parametrize("name", PAGES)
def test_generated_page_is_current(name: str) -> None:
    written = (REFERENCE / name).read_text(encoding="utf-8")
    assert written == PAGES[name](), "Write it again: python -m docs.generate"


@pytest.mark.parametrize("file", DATA, ids=lambda file: file.name)
def test_data_that_the_server_shows_is_current(file: Path) -> None:
    assert file.read_text(encoding="utf-8") == DATA[file](), "Write it again: python -m docs.generate"


def test_every_key_of_a_study_is_in_one_section() -> None:
    assert sorted(key for section in SECTIONS for key in section.keys) == sorted(Study.model_fields)


def rows(name: str) -> list[list[str]]:
    """The cells of every row of the page's tables, without the heads."""
    lines = (REFERENCE / name).read_text(encoding="utf-8").splitlines()
    lines = [line for line in lines if line.startswith("| ") and not re.match(r"\| (key|variable|argument) \|", line)]
    return [[cell.strip() for cell in re.split(r"(?<!\\)\|", line)[1:-1]] for line in lines]


def test_every_setting_has_a_meaning() -> None:
    meanings = {cells[0]: cells[-1] for cells in rows("settings.md")}
    assert set(meanings) == {f"`KITCHENMIND_{name.upper()}`" for name in Settings.model_fields}
    assert all(meanings.values())


def test_every_study_key_has_a_meaning_and_an_example() -> None:
    keys = [cells for section in SECTIONS for cells in rows(f"study_keys/{section.name}.md")]
    assert len(keys) > 150
    assert [cells[0] for cells in keys if not cells[-1]] == []
    plain = [cells for cells in keys if not re.search(r"\]\(\S*#", cells[1])]
    assert [cells[0] for cells in plain if not cells[3]] == []


def test_every_argument_of_every_command_has_a_meaning() -> None:
    arguments = [cells for cells in rows("command_line.md") if len(cells) == 3]
    assert len(arguments) > 100
    assert [cells[0] for cells in arguments if not cells[-1]] == []
