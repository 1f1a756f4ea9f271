"""How to install what some commands need and others do not."""

from pathlib import Path
from typing import Final

ROOT: Final = Path(__file__).resolve().parents[1]  # a checkout, or the folder in which packages are installed


def install_command(extra: str = "") -> str:
    """Return what to type: in a checkout, or where the wheel is installed. `extra`: `analysis`, `training` or none."""
    if (ROOT / "pyproject.toml").is_file():
        return "make setup"
    return f"pip install 'kitchenmind{f'[{extra}]' if extra else ''}'"
