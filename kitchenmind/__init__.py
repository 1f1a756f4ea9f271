"""kitchenmind in Python: `load` an export, `simulate` episodes, train in a `kitchen`, play a study with
`client`, let an agent of this process play with `serve_agent`.

Every name imports its package when it is first used, so that `import kitchenmind` and `kitchenmind --help` are quick.
"""

import importlib
from typing import TYPE_CHECKING, Any, Final

from kitchenmind.command_line import VERBS as VERBS
from kitchenmind.command_line import main as main

if TYPE_CHECKING:
    from kitchenmind import client as client
    from kitchenmind.kitchens import kitchen as kitchen
    from kitchenmind.loaded_export import load as load
    from kitchenmind.simulated_episodes import simulate as simulate
    from models.agents.agent_server import serve_agent as serve_agent

_PLACES: Final = {
    "load": "kitchenmind.loaded_export",
    "simulate": "kitchenmind.simulated_episodes",
    "kitchen": "kitchenmind.kitchens",
    "serve_agent": "models.agents.agent_server",
    "client": "kitchenmind.client",  # a package
}


def __getattr__(name: str) -> Any:
    """Import what `kitchenmind.NAME` means. Raises AttributeError."""
    if name not in _PLACES:
        raise AttributeError(f"module 'kitchenmind' has no attribute {name!r}. It has: {', '.join(_PLACES)}.")
    module = importlib.import_module(_PLACES[name])
    value = module if _PLACES[name] == f"{__name__}.{name}" else getattr(module, name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return sorted({*globals(), *_PLACES})
