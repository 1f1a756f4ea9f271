"""The documents match the repository: links, paths, commands, make targets and tests that they name exist."""

import re
import subprocess
from collections.abc import Iterator
from functools import cache
from pathlib import Path
from typing import Any

import yaml

import kitchenmind

ROOT = Path(__file__).parent.parent


@cache
def documents() -> dict[str, str]:
    listed = subprocess.run(["git", "ls-files", "*.md"], cwd=ROOT, capture_output=True, text=True, check=True)
    return {name: (ROOT / name).read_text(encoding="utf-8") for name in listed.stdout.split()}


def test_links_lead_somewhere() -> None:
    broken = [
        f"{name}: {target}"
        for name, text in documents().items()
        for target in re.findall(r"\]\(([^)#\s]+)[^)]*\)", text)
        if "://" not in target and not (ROOT / name).parent.joinpath(target).exists()
    ]
    assert broken == []


def test_make_targets_in_documents_exist() -> None:
    targets = set(re.findall(r"^([a-z-]+):", (ROOT / "Makefile").read_text(), re.MULTILINE))
    for name, text in documents().items():
        named = set(re.findall(r"(?:^|`)make ([a-z-]+)", text, re.MULTILINE))
        assert named <= targets, name


def test_verbs_in_documents_exist() -> None:
    for name, text in documents().items():
        named = set(re.findall(r"(?:\.venv/bin/|`)kitchenmind ([a-z]+)", text))
        assert named <= set(kitchenmind.VERBS), name


def test_paths_in_documents_exist() -> None:
    folders = "overcooked|models|training|analysis|server|tests|benchmarks|docs|studies|static|templates|migrations"
    folders += "|kitchenmind"
    missing = [
        f"{name}: {path}"
        for name, text in documents().items()
        for path in re.findall(rf"`((?:{folders})/[\w./-]+)`", text)
        if not any(part in path for part in ("*", "...", "__pycache__")) and not (ROOT / path).exists()
    ]
    assert missing == []


def test_figures_for_documents_have_a_script() -> None:
    for name, text in documents().items():
        for script in re.findall(r"benchmarks/\w+\.py", text):
            assert (ROOT / script).is_file(), f"{name}: {script}"


def test_tests_that_documents_name_exist() -> None:
    missing, named = [], 0
    for name, text in documents().items():
        for path, test in re.findall(r"`(tests/[\w/]+\.py)::(\w+)`", text):
            named += 1
            file = ROOT / path
            if not file.is_file() or not re.search(rf"^(?:async )?def {test}\(", file.read_text("utf-8"), re.MULTILINE):
                missing.append(f"{name}: {path}::{test}")
    assert missing == []
    assert named > 40


def test_every_check_of_the_screens_names_a_test() -> None:
    rows = re.findall(r"^\| (\d+) \|.*$", documents()["docs/explanation/ux_checks.md"], re.MULTILINE)
    held = re.findall(r"^\| (\d+) \|.*::test_.*$", documents()["docs/explanation/ux_checks.md"], re.MULTILINE)
    assert rows == held == [str(number) for number in range(1, 32)]


def test_decisions_have_unique_numbers_and_state_what_was_decided() -> None:
    pages = sorted((ROOT / "docs" / "decisions").glob("[0-9]*.md"))
    assert len({int(page.name[:4]) for page in pages}) == len(pages) >= 6
    for page in pages:
        text = page.read_text(encoding="utf-8")
        assert text.startswith(f"# {int(page.name[:4])}. ")
        assert "**Situation.**" in text
        assert "**Decision.**" in text


def glossary() -> list[str]:
    rows = re.findall(r"^\| ([^|]+?) \|", documents()["docs/reference/glossary.md"], re.MULTILINE)
    return rows[1:]


def test_glossary_is_in_alphabetical_order() -> None:
    words = [word.lower() for word in glossary()]
    assert words == sorted(words)


def site() -> dict[str, Any]:
    """mkdocs.yml; its Python names are read as plain words."""

    class MkdocsReader(yaml.SafeLoader):
        pass

    MkdocsReader.add_multi_constructor("tag:yaml.org,2002:python/name:", lambda loader, suffix, node: suffix)
    return yaml.load((ROOT / "mkdocs.yml").read_text(encoding="utf-8"), MkdocsReader)


def test_every_page_is_in_the_navigation_of_the_website_once() -> None:
    def pages(entries: list[Any]) -> Iterator[str]:
        for entry in entries:
            for value in entry.values() if isinstance(entry, dict) else [entry]:
                yield from pages(value) if isinstance(value, list) else [value]

    written = {name.removeprefix("docs/") for name in documents() if name.startswith("docs/")}
    assert sorted(pages(site()["nav"])) == sorted(name for name in written if not name.startswith("vendor/"))


def test_the_map_of_the_documents_leads_to_every_page() -> None:
    maps = {
        "docs/index.md": "tutorials|guides|reference(?!/study_keys/)|explanation",
        "docs/decisions/README.md": "decisions",
        "docs/reference/study_keys.md": "reference/study_keys",
    }
    for name, folders in maps.items():
        folder = (ROOT / name).parent
        linked = {(folder / target).resolve() for target in re.findall(r"\]\(([^)#]+)", documents()[name])}
        pages = {ROOT / page for page in documents() if re.match(rf"docs/({folders})/", page)} - {ROOT / name}
        assert pages - linked == set()


def test_decisions_are_listed_with_their_titles() -> None:
    titles = {page.name: page.read_text("utf-8").split("\n")[0] for page in (ROOT / "docs/decisions").glob("[0-9]*.md")}
    listed = re.findall(r"^(\d+\. )\[(.+)\]\((.+)\)$", documents()["docs/decisions/README.md"], re.MULTILINE)
    assert {name: f"# {number}{title}" for number, title, name in listed} == titles


def test_the_website_loads_nothing_from_other_servers() -> None:
    text = (ROOT / "mkdocs.yml").read_text(encoding="utf-8") + (ROOT / "docs/theme/main.html").read_text("utf-8")
    assert "://" not in text
    assert site()["theme"]["font"] is False
