"""A copy of the project in which the guides' training commands run, so that they do not publish into our weights."""

import os
import shlex
import shutil
import subprocess
import sys
from collections.abc import Mapping
from pathlib import Path

from tests.support.ctrl_c import ctrl_c_enabled

ROOT = Path(__file__).parent.parent.parent
PACKAGES = (
    "kitchenmind",
    "overcooked",
    "models",
    "training",
    "server",
    "analysis",
    "studies",
    "static",
    "templates",
    "migrations",
)


def build(folder: Path, *kitchens: str) -> Path:
    """Copy the project to `folder`, with the weights of these kitchens only."""
    leave_out = shutil.ignore_patterns("weights", "__pycache__")
    for name in PACKAGES:
        shutil.copytree(ROOT / name, folder / name, ignore=leave_out)
    shutil.copytree(ROOT / "docs" / "examples", folder / "docs" / "examples", ignore=leave_out)
    (folder / "models" / "weights").mkdir()
    for kitchen in kitchens:
        shutil.copytree(ROOT / "models" / "weights" / kitchen, folder / "models" / "weights" / kitchen)
    shutil.copy(ROOT / "alembic.ini", folder / "alembic.ini")
    return folder


def started(line: str, checkout: Path, shorter: Mapping[str, str]) -> "subprocess.Popen[str]":
    """Run a guide's command in the copy; `shorter` has what is added to a command that begins so."""
    settings, words = {}, shlex.split(line)
    while "=" in words[0]:
        name, _, value = words.pop(0).partition("=")
        settings[name] = str(checkout / value)
    bare = " ".join(words)
    more = next((extra for begin, extra in shorter.items() if bare.startswith(begin)), "")
    program = [sys.executable, "-m", "kitchenmind"] if words[0] == "kitchenmind" else [sys.executable]
    paths = os.pathsep.join([str(checkout), *settings.values()])
    with ctrl_c_enabled():
        return subprocess.Popen(
            [*program, *words[1:], *shlex.split(more)],
            cwd=checkout,
            env={**os.environ, "PYTHONPATH": paths, "PYTHONUNBUFFERED": "1"},
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
        )


def done(line: str, checkout: Path, shorter: Mapping[str, str], within_s: float = 280) -> str:
    """Return the output of a command that must succeed."""
    process = started(line, checkout, shorter)
    try:
        said, _ = process.communicate(timeout=within_s)
    finally:
        process.kill()
    assert process.returncode == 0, f"{line}\n{said}"
    return said
