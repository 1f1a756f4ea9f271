"""`kitchenmind.kitchen(...)`: the kitchen as a PettingZoo environment."""

from pathlib import Path
from typing import TYPE_CHECKING

from overcooked.constants import HORIZON
from overcooked.layout import Layout, load_layout

if TYPE_CHECKING:
    from overcooked.pettingzoo_env import KitchenEnv

_NEEDED = ("gymnasium", "pettingzoo")


def kitchen(layout: str | Path | Layout, horizon: int = HORIZON, render_mode: str | None = None) -> "KitchenEnv":
    """Return a PettingZoo ParallelEnv with the agents chef_0 and chef_1 (see `KitchenEnv`).

    `layout`: the name of a bundled layout, a .layout file or a `Layout`; `horizon`: timesteps until the episode ends.
    Raises LayoutError, and ModuleNotFoundError with the remedy if PettingZoo is not installed.
    """
    if horizon < 1:
        raise ValueError(f"horizon={horizon}: an episode has at least 1 timestep.")
    try:
        from overcooked.pettingzoo_env import KitchenEnv
    except ModuleNotFoundError as error:
        if error.name not in _NEEDED:
            raise
        remedy = f"pip install {' '.join(_NEEDED)}"
        raise ModuleNotFoundError(f"kitchenmind.kitchen needs {error.name}: {remedy}.", name=error.name) from None
    return KitchenEnv(layout if isinstance(layout, Layout) else load_layout(layout), horizon, render_mode)
