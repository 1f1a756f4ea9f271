"""Simulated participants for whom foresight can help. Nothing about people follows from them.

One participant is the same in every condition; only the evidence about the partner differs. `people` has what a
participant is like, `kitchen_map` the distances of a layout, `beliefs` what it takes the partner to do, `tasks` what it
wants, `route` how it gets there, `mind` puts them together for one timestep, and `cook` plays a game with it.
"""

from contextlib import suppress
from pathlib import Path

from overcooked import compiled

_HERE, _RULES = Path(__file__).parent, Path(compiled.__file__).parent
_KERNEL_SOURCES = (
    *(_HERE / f"{name}.py" for name in ("kitchen_map", "beliefs", "tasks", "route", "mind")),
    *(_RULES / f"{name}.py" for name in ("compiled", "constants", "rules")),
)

# The kernels call each other and the rules, and numba looks only at the file that a function is in.
with suppress(OSError):
    compiled.forget_code_older_than(_KERNEL_SOURCES, _HERE)
