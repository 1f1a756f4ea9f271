"""Simulated participants for whom foresight can help. They are not evidence about people. A participant is the same in
every condition; only the evidence about the partner differs. `people` has the traits, `kitchen_map` the distances of a
layout, `beliefs` the estimate of the partner's actions, `tasks` the choice of a station, `route` the path to it; `mind`
combines them for one timestep, and `cook` plays a game.
"""

from contextlib import suppress
from pathlib import Path

from overcooked import compiled

_HERE, _RULES = Path(__file__).parent, Path(compiled.__file__).parent
_KERNEL_SOURCES = (
    *(_HERE / f"{name}.py" for name in ("kitchen_map", "beliefs", "tasks", "route", "mind")),
    *(_RULES / f"{name}.py" for name in ("compiled", "constants", "rules")),
)

# The kernels call each other and the rules, but numba checks only the file that defines a function.
with suppress(OSError):
    compiled.forget_code_older_than(_KERNEL_SOURCES, _HERE)
