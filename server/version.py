"""The version of the running code, for the data: the package's version and, in a checkout, the revision."""

import subprocess
from functools import cache
from importlib.metadata import PackageNotFoundError, version

from server.settings import ROOT


@cache
def code_version() -> str:
    """Return e.g. 0.1.0+59e776d, with .dirty appended if files were changed; 0.1.0 outside a checkout."""
    try:
        released = version("kitchenmind")
    except PackageNotFoundError:
        released = "0"
    if not (ROOT / ".git").exists():
        return released
    command = ["git", "-C", str(ROOT), "describe", "--always", "--dirty=.dirty", "--exclude=*"]
    try:
        found = subprocess.run(command, capture_output=True, text=True, timeout=2, check=True)  # noqa: S603
    except (OSError, subprocess.SubprocessError):
        return released
    return f"{released}+{found.stdout.strip()}"
