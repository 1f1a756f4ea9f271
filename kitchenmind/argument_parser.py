"""The argument parser of every command of this project."""

import argparse
from typing import Any


class ExactArgumentParser(argparse.ArgumentParser):
    """Accepts options by their full names only. argparse takes a unique beginning for the option, so that a command
    without `--data` would read it as `--database`. The parsers of its own commands are of this class, too."""

    def __init__(self, *words: Any, **settings: Any) -> None:
        super().__init__(*words, **{"allow_abbrev": False, **settings})
