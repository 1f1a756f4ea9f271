"""Let two planners play a kitchen, in a process of low priority: the kitchen editor starts it.

`python -m server.commands.kitchen_trial EPISODES` reads the grid from standard input and prints the result as JSON.
"""

import json
import sys
from dataclasses import asdict

from models.agents.kitchen_trial import try_kitchen
from overcooked.layout import parse_layout
from server.commands.export_archive import give_way


def main(episodes: int, grid: str) -> int:
    """Print the points of each episode and the share of blocked steps. Raises LayoutError."""
    give_way()
    print(json.dumps(asdict(try_kitchen(parse_layout(grid), episodes))))
    return 0


if __name__ == "__main__":
    sys.exit(main(int(sys.argv[1]), sys.stdin.read()))
