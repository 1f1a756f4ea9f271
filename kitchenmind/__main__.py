"""`python -m kitchenmind`, and `python PATH/kitchenmind` from any folder."""

import sys
from pathlib import Path

# run by its path: Python put this folder on sys.path instead of the one with the packages
if __package__ in ("", None):
    sys.path[0] = str(Path(__file__).resolve().parents[1])

from kitchenmind.command_line import main

if __name__ == "__main__":
    sys.exit(main())
