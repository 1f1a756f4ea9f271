"""docs/explanation/security.md is consistent: every test that it names exists, and every item has one."""

import re
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
PAGES = ("security.md", "faults.md")


def rows_of(page: str) -> list[list[str]]:
    text = (ROOT / "docs" / "explanation" / page).read_text(encoding="utf-8")
    rows = [
        [cell.strip() for cell in line.strip("|").split("|")] for line in text.splitlines() if line.startswith("| ")
    ]
    return [
        row for row in rows if len(row) == {"security.md": 3, "faults.md": 4}[page] and row[0] not in ("item", "row")
    ]


def names_of_tests() -> set[str]:
    files = (ROOT / "tests").rglob("test_*.py")
    return {name for file in files for name in re.findall(r"def (test_\w+)", file.read_text(encoding="utf-8"))}


@pytest.mark.parametrize("page", PAGES)
def test_every_test_that_the_page_names_exists(page: str) -> None:
    named = {name for row in rows_of(page) for name in re.findall(r"`(test_\w+)`", row[-1])}
    assert named
    assert sorted(named - names_of_tests()) == []


def test_every_item_of_the_security_page_has_a_test() -> None:
    assert [row[0] for row in rows_of("security.md") if "`test_" not in row[-1]] == []


def test_all_faults_are_in_the_table() -> None:
    numbers = {int(row[0]) for row in rows_of("faults.md")}
    assert numbers == set(range(1, 32))
