"""The generated pages of docs/reference are those that the code gives now, and leave nothing out."""

import re

import pytest

from docs.generate import PAGES, REFERENCE
from server.settings import Settings


@pytest.mark.parametrize("name", PAGES)
def test_generated_page_is_current(name: str) -> None:
    written = (REFERENCE / name).read_text(encoding="utf-8")
    assert written == PAGES[name](), "Write it again: python -m docs.generate"


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
    keys = rows("study_keys.md")
    assert [cells[0] for cells in keys if not cells[-1]] == []
    plain = [cells for cells in keys if "](#" not in cells[1]]
    assert [cells[0] for cells in plain if not cells[3]] == []


def test_every_argument_of_every_command_has_a_meaning() -> None:
    arguments = [cells for cells in rows("command_line.md") if len(cells) == 3]
    assert len(arguments) > 100
    assert [cells[0] for cells in arguments if not cells[-1]] == []
