"""Run agents and predictors from ONNX files, whatever their input layout, number type and batch size."""

from pathlib import Path
from typing import Any, Final, cast

import numpy as np
from numpy.typing import NDArray

from models.agents.onnx_weights import external_files
from models.protocols import HISTORY, STEPS, BlackBoxError, Observations, Predictions, Probabilities
from overcooked.constants import ACTIONS
from overcooked.layout import Layout
from overcooked.planes import PLANES

_TYPES: Final[dict[str, Any]] = {
    "tensor(float)": np.float32,
    "tensor(float16)": np.float16,
    "tensor(double)": np.float64,
    "tensor(int8)": np.int8,
    "tensor(int16)": np.int16,
    "tensor(int32)": np.int32,
    "tensor(int64)": np.int64,
    "tensor(uint8)": np.uint8,
    "tensor(uint16)": np.uint16,
    "tensor(uint32)": np.uint32,
    "tensor(uint64)": np.uint64,
}


class _Model:
    """A loaded file with its inputs by name. A model with a fixed batch size is run in parts of that size."""

    def __init__(self, path: str, names: set[str] | None = None) -> None:
        self.path = path
        self._session = _session(path)
        self.inputs = {described.name: described for described in self._session.get_inputs()}
        if names is not None and set(self.inputs) != names:
            raise BlackBoxError(
                f"{path} has the inputs {sorted(self.inputs)}. Export a predictor with observations and actions."
            )
        sizes = {described.shape[0] for described in self.inputs.values() if described.shape}
        fixed = {size for size in sizes if isinstance(size, int)}
        if len(fixed) > 1 or not all(size > 0 for size in fixed):
            raise BlackBoxError(
                f"{path}: its inputs expect {sorted(fixed)} games. Export it with a free first dimension."
            )
        self._games: int | None = next(iter(fixed), None)

    def run(self, values: dict[str, NDArray[Any]]) -> NDArray[np.float32]:
        """Return the first output for all games, as probabilities. Raises BlackBoxError if the model fails."""
        games = len(next(iter(values.values())))
        size = self._games or games
        answers = []
        for start in range(0, games, size):
            part = {name: _filled(value[start : start + size], size) for name, value in values.items()}
            answers.append(self._run_once(part, size)[: games - start])
        return _softmax_if_needed(np.concatenate(answers))

    def _run_once(self, part: dict[str, NDArray[Any]], games: int) -> NDArray[np.float32]:
        try:
            (answer, *_) = self._session.run(None, part)
            array = np.asarray(answer, np.float32)
        except Exception as error:
            remedy = "Export it with a free first dimension (dynamic_axes), or with 1 as its first dimension."
            raise BlackBoxError(
                f"{self.path} fails with {games} games at once. {remedy} (onnxruntime: {_last_words(error)})"
            ) from error
        if array.ndim == 0 or len(array) != games:
            raise BlackBoxError(
                f"{self.path} returns the shape {array.shape} for {games} games. It must return one row per game."
            )
        return array


def _filled(part: NDArray[Any], size: int) -> NDArray[Any]:
    """Pad the last part with zeros to the model's batch size."""
    missing = size - len(part)
    return part if not missing else np.concatenate([part, np.zeros((missing, *part.shape[1:]), part.dtype)])


def _last_words(error: Exception) -> str:
    """Return the end of the runtime's message, which has the shapes; its beginning is the runtime's own source file."""
    words = " ".join(str(error).split())
    return words if len(words) <= 120 else f"... {words[-120:]}"


def _number_type(described: Any, source: str) -> Any:
    if described.type not in _TYPES:
        known = ", ".join(sorted(name[7:-1] for name in _TYPES))
        raise BlackBoxError(
            f"{source}: input {described.name!r} expects {described.type}, which is not supported. Cast it in the "
            f"model from one of {known}."
        )
    return _TYPES[described.type]


def _session(path: str) -> Any:
    import onnxruntime

    if not Path(path).is_file():
        raise BlackBoxError(f"there is no file {Path(path).absolute()}. Give the path of an ONNX model.")
    external_files(Path(path))  # refuses weights that are missing or outside the model's folder
    options = onnxruntime.SessionOptions()
    options.intra_op_num_threads = options.inter_op_num_threads = 1
    options.log_severity_level = 4  # errors are raised, so they need not also go to standard error
    try:
        return onnxruntime.InferenceSession(path, options, providers=["CPUExecutionProvider"])
    except Exception as error:
        raise BlackBoxError(f"{path} is not an ONNX model that can run here ({error}). Export it again.") from error


def _softmax_if_needed(given: NDArray[Any]) -> NDArray[np.float32]:
    """Return probabilities as they are; treat anything else as logits."""
    values = np.asarray(given, np.float32)
    numbers = values[~np.isnan(values).any(tuple(range(1, values.ndim)))]  # NaN of one game says nothing about others
    if len(numbers) and (numbers >= 0).all() and np.allclose(numbers.sum(axis=-1), 1, atol=1e-3):
        return values
    raised = np.exp(values - values.max(axis=-1, keepdims=True))
    return cast(NDArray[np.float32], raised / raised.sum(axis=-1, keepdims=True))


class _PlaneInput:
    """The form in which an ONNX model takes the planes: (..., width, height, 26), (..., 26, width, height) or flat; any
    number type."""

    def __init__(self, described: Any, layout: Layout, leading: int, source: str) -> None:
        self.name: str = described.name
        self._type = _number_type(described, source)
        shape = tuple(described.shape[leading:])
        last = (layout.width, layout.height, PLANES)
        self._first_planes = _fits(shape, (PLANES, layout.width, layout.height))
        self._flat = _fits(shape, (int(np.prod(last)),))
        if not (self._first_planes or self._flat or _fits(shape, last)):
            raise BlackBoxError(
                f"{source}: input {self.name!r} has the shape {described.shape}; on {layout.name} it must end in "
                f"{list(last)}, {[PLANES, *last[:2]]} or {[int(np.prod(last))]}."
            )

    def prepare(self, observations: NDArray[np.int8]) -> NDArray[Any]:
        if self._flat:
            observations = observations.reshape(*observations.shape[:-3], -1)
        elif self._first_planes:
            observations = np.moveaxis(observations, -1, -3)
        return np.ascontiguousarray(observations, self._type)


def _fits(shape: tuple[Any, ...], wanted: tuple[int, ...]) -> bool:
    """Return whether an ONNX shape, whose free sizes are names, admits the wanted one; the number of planes must be a
    number."""
    return len(shape) == len(wanted) and all(
        size == want or (not isinstance(size, int) and want != PLANES) for size, want in zip(shape, wanted, strict=True)
    )


class OnnxAgent:
    """An ONNX file: planes of (games, ...) in, (games, 6) probabilities or logits out."""

    def __init__(self, path: str, layout: Layout) -> None:
        self._model = _Model(path)
        inputs = list(self._model.inputs.values())
        if len(inputs) != 1:
            raise BlackBoxError(f"{path} has {len(inputs)} inputs. Export an agent with one, the planes.")
        self._input = _PlaneInput(inputs[0], layout, 1, path)

    def probabilities(self, observations: Observations) -> Probabilities:
        return self._model.run({self._input.name: self._input.prepare(observations)})


class OnnxPredictor:
    """An ONNX file with the paper's window: planes (games, 10, ...) and one-hot joint actions (games, 10, 12), oldest
    first, the current action zero; (games, 3, 6) probabilities or logits out. Before the start everything is zero."""

    memory = HISTORY

    def __init__(self, path: str, layout: Layout) -> None:
        self._model = _Model(path, {"observations", "actions"})
        self._input = _PlaneInput(self._model.inputs["observations"], layout, 2, path)
        self._action_type = _number_type(self._model.inputs["actions"], path)
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
        values = {self._input.name: self._input.prepare(states), "actions": actions.astype(self._action_type)}
        return self._model.run(values).reshape(len(slots), STEPS, ACTIONS)
