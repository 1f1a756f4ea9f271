"""Accept agents from Python code: a name, a class, or an object."""

from collections.abc import Callable
from typing import Any

from models.agents.blackbox import mode_of
from models.agents.catalogue import LoadedAgent, load_agent
from models.protocols import Policy
from overcooked.layout import Layout

GivenAgent = str | Policy | Callable[[Layout], Policy]


def loader_of(agent: GivenAgent) -> Callable[[Layout], LoadedAgent]:
    """Return a function that loads the agent for a kitchen. `agent`: a name as in a study file, a class (or function)
    that is called with the layout, or an object with `probabilities(observations)`. Raises TypeError for something
    else; what it returns raises TypeError, BlackBoxError, and whatever `load_agent` or the class raises."""
    if isinstance(agent, str):
        return lambda layout: load_agent(agent, layout)
    is_ready = not isinstance(agent, type) and hasattr(agent, "probabilities")
    if not is_ready and not callable(agent):
        raise TypeError(f"{agent!r} is not an agent. Give a name, a class, or an object with `probabilities`.")

    def load(layout: Layout) -> LoadedAgent:
        policy: Any = agent if is_ready else agent(layout)  # type: ignore[operator]
        if not callable(getattr(policy, "probabilities", None)):
            raise TypeError(
                f"{name_of(agent)} has no method probabilities(observations). See docs/guides/bring_your_own_agent.md."
            )
        return LoadedAgent(policy, mode_of(policy, name_of(agent)))

    return load


def name_of(agent: GivenAgent) -> str:
    """Return what to call the agent in a table or a message."""
    if isinstance(agent, str):
        return agent
    made_of = agent if isinstance(agent, type) or not hasattr(agent, "probabilities") else type(agent)
    return str(getattr(made_of, "__name__", type(made_of).__name__))
