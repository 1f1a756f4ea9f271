"""The studies that come with kitchenmind, by the names that the documentation gives them: `studies/quick_look.yaml`."""

import argparse
import sys
from pathlib import Path
from typing import Any, Final

ROOT: Final = Path(__file__).resolve().parents[1]  # a checkout, or the folder in which packages are installed
_OPTIONS: Final = ("study", "file", "source", "place")  # of the commands that read a study file


def use_bundled_studies(arguments: argparse.Namespace) -> None:
    """Replace each study file that is not here by the one with this name that comes with kitchenmind, and say so.

    After `pip install`, no folder `studies` is in the folder where the commands run."""
    for option in _OPTIONS:
        given = getattr(arguments, option, None)
        if isinstance(given, list):
            setattr(arguments, option, [_found(one) for one in given])
        elif given is not None:
            setattr(arguments, option, _found(given))


def _found(given: Any) -> Any:
    if not isinstance(given, Path) or given.is_absolute() or given.parts[:1] != ("studies",) or given.exists():
        return given
    bundled = ROOT / given
    if ".." in given.parts or not bundled.is_file():
        return given
    print(f"{given} is not here: using the one that comes with kitchenmind, {bundled}", file=sys.stderr)
    return bundled
