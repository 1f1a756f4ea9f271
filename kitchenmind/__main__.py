"""`python -m kitchenmind`, and `python PATH/kitchenmind` from any folder."""

import sys
from pathlib import Path

if __package__ in ("", None):  # run by its path: Python put this folder on its path, and not the one with the packages
    sys.path[0] = str(Path(__file__).resolve().parents[1])

from kitchenmind.command_line import main

if __name__ == "__main__":
    sys.exit(main())
