"""Simulated participants for whom foresight can help. Nothing about people follows from them.

One participant is the same in every condition; only the evidence about the partner differs. `people` has what a
participant is like, `kitchen_map` the distances of a layout, `beliefs` what it takes the partner to do, `tasks` what it
wants, `route` how it gets there, `mind` puts them together for one timestep, and `cook` plays a game with it.
"""

from contextlib import suppress
from pathlib import Path

from overcooked import compiled, constants, rules

_HERE = Path(__file__).parent

# Its kernels call each other and the rules, and numba looks only at the file that a function is in.
with suppress(OSError):
    compiled.forget_code_older_than(
        [
            *(_HERE / f"{name}.py" for name in ("kitchen_map", "beliefs", "tasks", "route", "mind")),
            *(Path(source.__file__) for source in (compiled, constants, rules)),
        ],
        _HERE,
    )
