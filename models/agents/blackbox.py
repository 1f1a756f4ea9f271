"""Load agents and predictors from outside this project as black boxes: an ONNX file, a Python class, an HTTP address.
They get the 26 planes of the chef that they play and return probabilities (or an action) for it. No torch here.
"""

import importlib
import sys
from collections.abc import Callable
from typing import Any, cast

from models.agents.checked_policy import explained
from models.agents.http_agent import HttpAgent
from models.agents.model_paths import make_importable
from models.agents.onnx_models import OnnxAgent, OnnxPredictor
from models.protocols import BlackBoxError as BlackBoxError
from models.protocols import Mode, Policy, Predictor
from overcooked.layout import Layout

# its probabilities are used as they are: a deterministic agent gives a 1
AS_IT_SAYS = Mode(temperature=1.0, stuck_mix=0.0)
_WHERE = "Write package.module:Class. Modules are searched for in the study's and the current folder and in PYTHONPATH."


def is_foreign(name: str) -> bool:
    """Return whether a name means a model from outside this project: an ONNX file, `module:Class` or an http
    address."""
    return ":" in name or name.partition("@")[0].endswith(".onnx")


def load_foreign_agent(name: str, layout: Layout) -> tuple[Policy, Mode]:
    """Return the agent called `name` on this layout, and how it acts (its attribute `mode` if it has one). Raises
    BlackBoxError."""
    if name.startswith(("http://", "https://")):
        return HttpAgent(name, layout), AS_IT_SAYS
    if name.endswith(".onnx"):
        return OnnxAgent(name, layout), AS_IT_SAYS
    agent = _python_object(name, layout, "probabilities")
    return cast(Policy, agent), mode_of(agent, name)


def mode_of(agent: Any, name: str) -> Mode:
    """Return how an agent acts: its attribute `mode`, else by its probabilities. Raises BlackBoxError if that is
    something else."""
    mode = getattr(agent, "mode", AS_IT_SAYS)
    if not isinstance(mode, Mode):
        remedy = "Remove it, or set it to a models.protocols.Mode such as Mode(temperature=0.0)."
        raise BlackBoxError(f"{name} has the attribute mode = {mode!r:.60}. {remedy}")
    return mode


def load_foreign_predictor(name: str, layout: Layout) -> Predictor:
    """Return the predictor called `name` on this layout. Raises BlackBoxError."""
    if name.endswith(".onnx"):
        return OnnxPredictor(name, layout)
    if name.startswith(("http://", "https://")):
        raise BlackBoxError(f"{name}: a predictor cannot be used over HTTP. Give an ONNX file or module:Class.")
    return cast(Predictor, _python_object(name, layout, "predict"))


def _python_object(name: str, layout: Layout, method: str) -> Any:
    thing = _class(name)
    try:
        made = thing(layout)
    except Exception as error:
        remedy = "Its constructor gets one argument, the layout."
        raise BlackBoxError(f"{name} cannot be made: {explained(error)}. {remedy}") from error
    if not callable(getattr(made, method, None)):
        raise BlackBoxError(f"{name} has no method {method}(...). See docs/guides/bring_your_own_agent.md.")
    return made


def _class(name: str) -> Callable[[Layout], Any]:
    """Import what `module:Class` names. Raises BlackBoxError."""
    module_name, _, class_name = name.partition(":")
    if not module_name or not class_name:
        raise BlackBoxError(f"{name} was not found. {_WHERE}")
    make_importable(())
    try:
        module = importlib.import_module(module_name)
    except ModuleNotFoundError as error:
        if error.name is not None and not f"{module_name}.".startswith(f"{error.name}."):
            remedy = f"Install it for {sys.executable}."
            raise BlackBoxError(f"{name} needs the Python package {error.name}. {remedy}") from error
        raise BlackBoxError(f"{name} was not found ({error}). {_WHERE}") from error
    except (Exception, SystemExit) as error:
        raise _not_importable(name, error) from error
    try:
        return cast(Callable[[Layout], Any], getattr(module, class_name))
    except AttributeError as error:
        raise BlackBoxError(f"{name} was not found ({error}). {_WHERE}") from error


def _not_importable(name: str, error: BaseException) -> BlackBoxError:
    remedy = "Correct its code."
    if isinstance(error, SystemExit):
        remedy = 'Move the code that runs as a program under `if __name__ == "__main__":`.'
    return BlackBoxError(f"{name} cannot be imported: {explained(error)}. {remedy}")
