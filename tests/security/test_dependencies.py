"""The list of dependencies matches what is installed, and every licence permits use in a laboratory."""

import ast
import tomllib
from pathlib import Path

import pytest

from tests.security import list_dependencies

ROOT = Path(__file__).resolve().parents[2]


def listed() -> dict[str, tuple[str, str]]:
    """Name -> version and licence, as docs/reference/dependencies.md has it."""
    lines = (ROOT / "docs" / "reference" / "dependencies.md").read_text(encoding="utf-8").splitlines()
    cells = [[cell.strip() for cell in line.strip("|").split("|")] for line in lines if line.startswith("| ")]
    return {name: (version, licence) for name, version, _, licence in cells if name != "package"}


def test_everything_that_is_installed_with_us_is_listed_with_its_pin() -> None:
    written, installed = listed(), {name: version for name, version, _, _ in list_dependencies.rows()}
    missing = sorted(name for name, version in installed.items() if name not in written or written[name][0] != version)
    assert missing == [], "python tests/security/list_dependencies.py > docs/reference/dependencies.md"


def test_no_licence_is_missing_or_forbids_what_we_do() -> None:
    reaching = {name: licence for name, (_, licence) in listed().items() if name not in list_dependencies.ONLY_RUN}
    assert [name for name, licence in reaching.items() if not list_dependencies.ALLOWED.search(licence)] == []


@pytest.mark.parametrize("extra", list_dependencies.EXTRAS)
def test_our_own_dependencies_are_pinned_to_one_version(extra: str) -> None:
    for pin in list_dependencies.wanted()[extra]:
        assert str(pin.specifier).startswith("=="), pin


def test_what_a_server_installs_takes_600_mb_at_most() -> None:
    assert 100 < list_dependencies.size_mb("serve") <= 600


def test_extras_are_all_looked_at() -> None:
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    assert set(list_dependencies.EXTRAS) == {"serve", *project["optional-dependencies"]}


# Packages that others load by name, and where.
LOADED_BY_NAME = {"uvloop": "uvicorn, as `loop`", "websockets": "uvicorn, as `ws`"}
IMPORTED_AS = {"argon2-cffi": "argon2", "markdown-it-py": "markdown_it", "pyyaml": "yaml"}


def test_every_dependency_of_the_server_is_imported_somewhere() -> None:
    imported = {
        name.split(".")[0]
        for file in (ROOT / package for package in ("overcooked", "models", "training", "analysis", "server"))
        for path in file.rglob("*.py")
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8")))
        for name in _imports(node)
    }
    names = {pin.name for pin in list_dependencies.wanted()["serve"]} - LOADED_BY_NAME.keys()
    assert {name for name in names if IMPORTED_AS.get(name, name.replace("-", "_")) not in imported} == set()


def _imports(node: ast.AST) -> list[str]:
    if isinstance(node, ast.Import):
        return [alias.name for alias in node.names]
    return [node.module] if isinstance(node, ast.ImportFrom) and node.module else []
