"""Other people's agents and predictors, known only by what they answer: an ONNX file, a Python class, an HTTP address.

They see the 26 planes of the chef they play and give probabilities (or an action) for it. No torch here.
"""

import http.client
import importlib
from collections.abc import Callable
from pathlib import Path
from typing import Any, cast
from urllib.parse import urlsplit

import msgspec
import numpy as np
from numpy.typing import NDArray

from models.model_paths import make_importable
from models.protocols import HISTORY, STEPS, Mode, Observations, Policy, Predictions, Predictor, Probabilities
from overcooked.constants import ACTIONS
from overcooked.layout import Layout
from overcooked.observe import PLANES

AS_IT_SAYS = Mode(temperature=1.0, stuck_mix=0.0)  # its probabilities are what it means: a certain agent gives a 1
HTTP_TIMEOUT_S = 2.0


class BlackBoxError(ValueError):
    """A foreign model that cannot be used; the text says why and what to do."""


def is_foreign(name: str) -> bool:
    """Whether a name means somebody else's model: an ONNX file, `module:Class` or an http address."""
    return ":" in name or name.partition("@")[0].endswith(".onnx")


def load_foreign_agent(name: str, layout: Layout) -> tuple[Policy, Mode]:
    """The agent called `name` on this layout, and how it acts (its attribute `mode` if it has one). Raises
    BlackBoxError."""
    if name.startswith(("http://", "https://")):
        return HttpAgent(name, layout), AS_IT_SAYS
    if name.endswith(".onnx"):
        return OnnxAgent(name, layout), AS_IT_SAYS
    agent = _python_object(name, layout, "probabilities")
    return cast(Policy, agent), cast(Mode, getattr(agent, "mode", AS_IT_SAYS))


def load_foreign_predictor(name: str, layout: Layout) -> Predictor:
    """The predictor called `name` on this layout. Raises BlackBoxError."""
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


def _session(path: str) -> Any:
    import onnxruntime

    if not Path(path).is_file():
        raise BlackBoxError(f"there is no file {path}. Give the path of an ONNX model.")
    options = onnxruntime.SessionOptions()
    options.intra_op_num_threads = options.inter_op_num_threads = 1
    options.log_severity_level = 3
    try:
        return onnxruntime.InferenceSession(path, options, providers=["CPUExecutionProvider"])
    except Exception as error:
        raise BlackBoxError(f"{path} is no ONNX model that can be run here ({error}).") from error


def _softmax_if_needed(given: NDArray[Any]) -> NDArray[np.float32]:
    """Probabilities as they are; anything else is taken for logits."""
    values = np.asarray(given, np.float32)
    if (values >= 0).all() and np.allclose(values.sum(axis=-1), 1, atol=1e-3):
        return values
    raised = np.exp(values - values.max(axis=-1, keepdims=True))
    return cast(NDArray[np.float32], raised / raised.sum(axis=-1, keepdims=True))


class _PlaneInput:
    """How an ONNX model wants the planes: (..., width, height, 26), (..., 26, width, height) or flat; any number
    type."""

    def __init__(self, described: Any, layout: Layout, leading: int, source: str) -> None:
        self.name: str = described.name
        self._type = {"tensor(float)": np.float32, "tensor(int8)": np.int8, "tensor(double)": np.float64}.get(
            described.type
        )
        shape = tuple(described.shape[leading:])
        last = (layout.width, layout.height, PLANES)
        self._first_planes = _fits(shape, (PLANES, layout.width, layout.height))
        self._flat = _fits(shape, (int(np.prod(last)),))
        if self._type is None or not (self._first_planes or self._flat or _fits(shape, last)):
            raise BlackBoxError(
                f"{source}: input {self.name!r} is {described.type} {described.shape}; on {layout.name} it must end in "
                f"{list(last)}, {[PLANES, *last[:2]]} or {[int(np.prod(last))]}."
            )

    def prepare(self, observations: NDArray[np.int8]) -> NDArray[Any]:
        if self._flat:
            observations = observations.reshape(*observations.shape[:-3], -1)
        elif self._first_planes:
            observations = np.moveaxis(observations, -1, -3)
        return np.ascontiguousarray(observations, self._type)


def _fits(shape: tuple[Any, ...], wanted: tuple[int, ...]) -> bool:
    """Whether an ONNX shape, whose free sizes are names, admits the wanted one; the number of planes must be written
    out."""
    return len(shape) == len(wanted) and all(
        size == want or (not isinstance(size, int) and want != PLANES) for size, want in zip(shape, wanted, strict=True)
    )


class OnnxAgent:
    """An ONNX file: planes of (games, ...) in, (games, 6) probabilities or logits out."""

    def __init__(self, path: str, layout: Layout) -> None:
        self._run = _session(path)
        inputs = self._run.get_inputs()
        if len(inputs) != 1:
            raise BlackBoxError(f"{path} has {len(inputs)} inputs; an agent has one, the planes.")
        self._input = _PlaneInput(inputs[0], layout, 1, path)

    def probabilities(self, observations: Observations) -> Probabilities:
        (answer, *_) = self._run.run(None, {self._input.name: self._input.prepare(observations)})
        return _softmax_if_needed(answer)


class OnnxPredictor:
    """An ONNX file with the paper's window: planes (games, 10, ...) and one-hot joint actions (games, 10, 12), oldest
    first, the current action zero; (games, 3, 6) probabilities or logits out. Before the start everything is zero."""

    memory = HISTORY

    def __init__(self, path: str, layout: Layout) -> None:
        self._run = _session(path)
        inputs = {described.name: described for described in self._run.get_inputs()}
        if set(inputs) != {"observations", "actions"}:
            raise BlackBoxError(f"{path} has the inputs {sorted(inputs)}; a predictor has observations and actions.")
        self._input = _PlaneInput(inputs["observations"], layout, 2, path)
        self._states = np.zeros((0, HISTORY, layout.width, layout.height, PLANES), np.int8)
        self._actions = np.zeros((0, HISTORY, 2 * ACTIONS), np.float32)

    def begin(self, slots: NDArray[np.intp]) -> None:
        missing = int(slots.max(initial=-1)) + 1 - len(self._states)
        if missing > 0:
            self._states = np.concatenate([self._states, np.zeros((missing, *self._states.shape[1:]), np.int8)])
            self._actions = np.concatenate([self._actions, np.zeros((missing, *self._actions.shape[1:]), np.float32)])
        self._states[slots] = 0
        self._actions[slots] = 0

    def predict(
        self, slots: NDArray[np.intp], observations: Observations, last_actions: NDArray[np.int8]
    ) -> Predictions:
        states, actions = self._states[slots], self._actions[slots]
        actions[:, -1] = np.concatenate(
            [np.eye(ACTIONS)[last_actions[:, k]] * (last_actions[:, k : k + 1] >= 0) for k in (0, 1)], 1
        )
        states[:, :-1] = states[:, 1:]
        actions[:, :-1] = actions[:, 1:]
        states[:, -1] = observations
        actions[:, -1] = 0
        self._states[slots], self._actions[slots] = states, actions
        (answer, *_) = self._run.run(None, {self._input.name: self._input.prepare(states), "actions": actions})
        return _softmax_if_needed(answer).reshape(len(slots), STEPS, ACTIONS)


class HttpAgent:
    """An address that answers POST {"layout", "grid", "observations": (games, width, height, 26)} with
    {"probabilities": (games, 6)} or {"actions": (games,)}."""

    def __init__(self, url: str, layout: Layout) -> None:
        self._url = url
        parts = urlsplit(url)
        kind = http.client.HTTPSConnection if parts.scheme == "https" else http.client.HTTPConnection
        self._connection = kind(parts.netloc, timeout=HTTP_TIMEOUT_S)
        self._path = (parts.path or "/") + (f"?{parts.query}" if parts.query else "")
        self._layout = layout

    def probabilities(self, observations: Observations) -> Probabilities:
        question = {"layout": self._layout.name, "grid": self._layout.grid, "observations": observations.tolist()}
        try:
            headers = {"Content-Type": "application/json"}
            self._connection.request("POST", self._path, msgspec.json.encode(question), headers)
            response = self._connection.getresponse()
            body = response.read()
            if response.status != http.client.OK:
                raise BlackBoxError(f"{self._url} answered {response.status}.")
            return self._read(msgspec.json.decode(body), len(observations))
        except (OSError, http.client.HTTPException, msgspec.DecodeError) as error:
            self._connection.close()
            raise BlackBoxError(f"{self._url} does not answer as an agent should ({error}).") from error

    def close(self) -> None:
        """Leaves the address; the next question calls it again."""
        self._connection.close()

    def _read(self, answer: Any, games: int) -> Probabilities:
        if isinstance(answer, dict) and "actions" in answer:
            actions = np.asarray(answer["actions"], np.int64).reshape(games)
            if ((actions < 0) | (actions >= ACTIONS)).any():
                raise BlackBoxError(f"{self._url} gave an action outside 0-{ACTIONS - 1}.")
            return np.eye(ACTIONS, dtype=np.float32)[actions]
        if isinstance(answer, dict) and "probabilities" in answer:
            return np.asarray(answer["probabilities"], np.float32)
        raise BlackBoxError(f"{self._url} must answer with probabilities or actions.")
