"""Prints docs/reference/dependencies.md: everything that is installed with kitchenmind, why, and under which licence.

python tests/security/list_dependencies.py > docs/reference/dependencies.md
"""

import re
import sys
import tomllib
from collections.abc import Iterator
from importlib import metadata
from pathlib import Path

from packaging.requirements import Requirement

ROOT = Path(__file__).resolve().parents[2]
EXTRAS = ("serve", "training", "analysis", "cluster", "test", "docs")
# Licences that let a laboratory use, change and pass on what it builds; LGPL and MPL for parts that are used unchanged.
ALLOWED = re.compile(
    r"MIT|BSD|Apache|PSF|Python Software Foundation|ISC|MPL|Mozilla|LGPL|Lesser General Public|Unlicense|Zlib|CC0|HPND|"
    r"public domain|Historical Permission|0BSD|CNRI|Academic Free|Artistic|Boost|Matplotlib",
    re.IGNORECASE,
)
# What torch's builds for graphics cards bring along, another set for each; the build for processors brings none of it.
OF_GRAPHICS_CARDS = re.compile(r"(nvidia|cuda)-.*|triton")
# Programs that only `make lint` runs: no part of what is built or passed on, so their licence does not reach it.
ONLY_RUN = {"codespell"}
# What does not say its licence in words that a program finds; read in the package itself.
SAID_ELSEWHERE = {"axe-playwright-python": "MIT", "mlcroissant": "Apache-2.0"}


def canonical(name: str) -> str:
    return re.sub(r"[-_.]+", "-", name).lower()


def wanted() -> dict[str, list[Requirement]]:
    """Our own pins by extra; "serve" is what `pip install kitchenmind` brings."""
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    lists = {"serve": project["dependencies"], **project["optional-dependencies"]}
    return {extra: [Requirement(line) for line in lists[extra]] for extra in EXTRAS}


def needs(name: str, extras: frozenset[str]) -> Iterator[tuple[str, frozenset[str]]]:
    """What an installed package needs here."""
    try:
        lines = metadata.requires(name) or []
    except metadata.PackageNotFoundError:
        return
    for requirement in map(Requirement, lines):
        marker = requirement.marker
        if marker is None or any(marker.evaluate({"extra": extra}) for extra in extras or {""}):
            yield requirement.name, frozenset(requirement.extras)


def closure(pins: list[Requirement]) -> set[str]:
    """Canonical names of all that comes with these pins, as far as it is installed."""
    found: set[str] = set()
    waiting = [(pin.name, frozenset(pin.extras)) for pin in pins]
    while waiting:
        name, extras = waiting.pop()
        if canonical(name) in found or not is_installed(name) or OF_GRAPHICS_CARDS.fullmatch(canonical(name)):
            continue
        found.add(canonical(name))
        waiting.extend(needs(name, extras))
    return found


def is_installed(name: str) -> bool:
    try:
        metadata.distribution(name)
    except metadata.PackageNotFoundError:
        return False
    return True


def size_mb(extra: str) -> float:
    """What these packages take on disk, from the lists of their files, without compiled Python (pip --no-compile)."""
    files = [file for name in closure(wanted()[extra]) for file in metadata.files(name) or []]
    return sum(file.size or 0 for file in files if file.suffix != ".pyc") / 1e6


def licence(name: str) -> str:
    """In the package's own words, one line."""
    about = metadata.metadata(name)
    stated = about.get("License-Expression")
    if stated:
        return str(stated)
    classes = [
        line.rpartition(" :: ")[2] for line in about.get_all("Classifier") or [] if line.startswith("License ::")
    ]
    classes = [one for one in classes if one not in ("OSI Approved", "License")]
    if classes:
        return ", ".join(sorted(set(classes)))
    text = str(about.get("License") or "").strip().split("\n")[0]
    return SAID_ELSEWHERE.get(canonical(name)) or text[:60] or "not said"


def rows() -> Iterator[tuple[str, str, str, str]]:
    """Name, our pin, where it comes in first, licence; sorted by name."""
    where: dict[str, str] = {}
    pins = {canonical(pin.name): str(pin.specifier).removeprefix("==") for extra in wanted().values() for pin in extra}
    for extra, requirements in wanted().items():
        for name in closure(requirements):
            where.setdefault(name, extra)
    for name in sorted(where):
        yield name, pins.get(name, ""), where[name], licence(name)


def document() -> str:
    lines = [
        "# Dependencies",
        "",
        "Every package that is installed with kitchenmind. `tests/security/list_dependencies.py` prints this page;",
        "a test compares. *For*: `serve` is what a server needs, the others are the extras of `pyproject.toml`. A",
        "package with a version is pinned there; the others are dependencies of these. Nothing is downloaded at",
        "run time, and no page loads anything from other servers. `make audit` asks PyPI about known",
        "vulnerabilities.",
        "Not listed: torch's CUDA builds include `triton` (MIT) and NVIDIA's libraries (`nvidia-*`, `cuda-*`, under",
        "NVIDIA's licence). The CPU build does not include them, and kitchenmind does not need them.",
        "",
        f"On Linux with x86-64, the packages of a server take {size_mb('serve'):.0f} MB on disk.",
        "",
        "| package | version | for | licence |",
        "|---|---|---|---|",
        *(f"| {name} | {version} | {extra} | {words} |" for name, version, extra, words in rows()),
    ]
    return "\n".join(lines) + "\n"


if __name__ == "__main__":
    sys.stdout.write(document())
