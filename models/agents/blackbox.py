"""Load agents and predictors from outside this project as black boxes: an ONNX file, a Python class, an HTTP address.
They get the 26 planes of the chef that they play and return probabilities (or an action) for it. No torch here.
"""

import importlib
from collections.abc import Callable
from typing import Any, cast

from models.agents.http_agent import HttpAgent
from models.agents.model_paths import make_importable
from models.agents.onnx_models import OnnxAgent, OnnxPredictor
from models.protocols import BlackBoxError as BlackBoxError
from models.protocols import Mode, Policy, Predictor
from overcooked.layout import Layout

# its probabilities are used as they are: a deterministic agent gives a 1
AS_IT_SAYS = Mode(temperature=1.0, stuck_mix=0.0)


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
    return cast(Policy, agent), cast(Mode, getattr(agent, "mode", AS_IT_SAYS))


def load_foreign_predictor(name: str, layout: Layout) -> Predictor:
    """Return the predictor called `name` on this layout. Raises BlackBoxError."""
    if name.endswith(".onnx"):
        return OnnxPredictor(name, layout)
    if name.startswith(("http://", "https://")):
        raise BlackBoxError(f"{name}: a predictor cannot be asked over HTTP. Give an ONNX file or module:Class.")
    return cast(Predictor, _python_object(name, layout, "predict"))


def _python_object(name: str, layout: Layout, method: str) -> Any:
    module_name, _, class_name = name.partition(":")
    make_importable(())
    try:
        factory: Callable[[Layout], Any] = getattr(importlib.import_module(module_name), class_name)
    except (ImportError, AttributeError) as error:
        remedy = "Write package.module:Class. It is looked for in the study's and the current folder and in PYTHONPATH."
        raise BlackBoxError(f"{name} is not there ({error}). {remedy}") from error
    thing = factory(layout)
    if not callable(getattr(thing, method, None)):
        raise BlackBoxError(f"{name} has no method {method}(...). See docs/guides/bring_your_own_agent.md.")
    return thing
