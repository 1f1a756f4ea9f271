"""A model worker: a process that loads agents and predictors and answers frames until the server is gone.

Started by `models.inference.runner` as `python -m models.inference.worker FD`.
"""

import gc
import signal
import socket
import sys
import time
from collections.abc import Callable, Iterator
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from models.acting import distribution, draw
from models.agents.catalogue import load_agent
from models.agents.fingerprints import files_sha256
from models.agents.model_paths import make_importable
from models.agents.predictors import load_predictor
from models.inference import attention
from models.inference.answer_arrays import AnswerArrays
from models.inference.batches import group_requests, merge_requests, split_answer
from models.inference.checked_output import (
    checked_intentions,
    checked_predictions,
    checked_probabilities,
    usable_rows,
)
from models.inference.circuit_breaker import Breaker
from models.inference.watched_call import WatchedCall, some_unusable
from models.inference.wire import (
    APART,
    Answer,
    Failed,
    Forget,
    Inbox,
    Load,
    Loaded,
    ModelFault,
    ModelRequest,
    Name,
    Row,
    frame,
    from_server,
)
from models.protocols import (
    HISTORY,
    STEPS,
    Intentions,
    Mode,
    Observations,
    Policy,
    Predictions,
    Predictor,
    Probabilities,
)
from overcooked.constants import ACTIONS, HORIZON, PLAYERS
from overcooked.layout import Layout, load_layout, parse_layout
from overcooked.state import Kitchens

AGENT, PREDICTOR = "agent", "predictor"
Loading = TypeVar("Loading")


class ModelRefused(Exception):
    """A model that does not load or does not fit its layout."""


class Slots:
    """The games that a predictor watches: game key -> slot number; numbers are reused. `reached`: the newest timestep
    seen of each."""

    def __init__(self) -> None:
        self.reached: dict[str, int] = {}
        self._of: dict[str, int] = {}
        self._free: list[int] = []

    def slot(self, key: str) -> int:
        if key not in self._of:
            self._of[key] = self._free.pop() if self._free else len(self._of)
        return self._of[key]

    def forget(self, key: str) -> None:
        self.reached.pop(key, None)
        if key in self._of:
            self._free.append(self._of.pop(key))


class Worker:
    """All that one process has loaded."""

    def __init__(self, load: Load) -> None:
        """Load and try every model. Raises ModelRefused, saying which cannot be used and why."""
        self._agents: dict[Name, tuple[Policy, Mode]] = {}
        self._predictors: dict[Name, tuple[Predictor, Slots]] = {}
        self._layouts: dict[str, Layout] = {}
        self._breakers: dict[tuple[Name, str], Breaker] = {}  # of an agent and of a predictor of the same name
        self._grids, self._files, self._wanted = load.grids, load.files, load.hashes
        self.hashes: dict[str, str] = {}
        make_importable(load.folders)
        for name in load.agents:
            self._agents[name] = _refusing(self._load_agent, name)
        for name in load.predictors:
            self._predictors[name] = (_refusing(self._load_predictor, name), Slots())
        memories = (getattr(predictor, "memory", HISTORY) for predictor, _ in self._predictors.values())
        self.memory = max(map(int, memories), default=1)

    def _layout(self, name: str) -> Layout:
        if name not in self._layouts:
            grid = self._grids.get(name)
            self._layouts[name] = load_layout(name) if grid is None else parse_layout(grid, name.partition(APART)[0])
        return self._layouts[name]

    def _load_agent(self, name: Name) -> tuple[Policy, Mode]:
        layout, file = self._layout(name[0]), self._files.get("/".join(name), name[1])
        self._check_files(name, file, layout)
        policy, mode = load_agent(file, layout)
        for observations in _start_states(layout):
            checked_probabilities(policy.probabilities(observations), len(observations))
        self._breakers[name, AGENT] = Breaker()
        return policy, mode

    def _check_files(self, name: Name, file: str, layout: Layout) -> None:
        """Refuse files that have changed since an earlier worker loaded them: the data name the model by its hash."""
        key, found = "/".join(name), files_sha256(file, layout)
        self.hashes[key] = found
        if self._wanted.get(key, found) != found:
            raise ValueError("its files have changed since the server started. Put them back, or restart the server")

    def _load_predictor(self, name: Name) -> Predictor:
        layout, file = self._layout(name[0]), self._files.get("/".join(name), name[1])
        self._check_files(name, file, layout)
        predictor = load_predictor(file, layout)
        for observations in _start_states(layout):
            slots = np.arange(len(observations), dtype=np.intp)
            predictor.begin(slots)
            nothing = np.full((len(slots), 2), -1, np.int8)
            checked_predictions(predictor.predict(slots, observations, nothing), len(slots))
            checked_intentions(predictor, slots, observations, nothing)
        self._breakers[name, PREDICTOR] = Breaker()
        return predictor

    def forget(self, keys: list[str]) -> None:
        for _, slots in self._predictors.values():
            for key in keys:
                slots.forget(key)

    def answer(self, ask: ModelRequest) -> Answer:
        """Answer a request. Never raises for a failing model: its rows stay unanswered and the fault is reported."""
        started = time.perf_counter()
        rows = ask.rows
        states = np.cumsum([row.states for row in rows]) - 1  # the index of each row's newest state
        observations = self._observations(ask)
        actions = np.frombuffer(ask.actions, np.int8).reshape(-1, 2)
        found = AnswerArrays.unanswered(len(rows))
        faults: list[ModelFault] = []
        for agent, chosen in _by_model([row.agent for row in rows]):
            name = ask.layout, agent
            with WatchedCall(name, self._breakers[name, AGENT], faults) as may_answer:
                if may_answer:
                    found.action_distributions[chosen], found.acted[chosen] = self._act(
                        name, [rows[k] for k in chosen], observations[states[chosen]]
                    )
                    faults += some_unusable(name, found.acted[chosen] >= 0)
        for predictor, known in _by_model([row.predictor for row in rows]):
            name = ask.layout, predictor
            chosen = self._follow(name, rows, known)
            with WatchedCall(name, self._breakers[name, PREDICTOR], faults) as may_answer:
                if may_answer and len(chosen):
                    found.predictions[chosen], found.intentions[chosen], usable = self._predict(
                        name, [rows[k] for k in chosen], states[chosen], observations, actions
                    )
                    found.predicted[chosen] = usable
                    faults += some_unusable(name, usable)
        return found.packed(ask.id, (time.perf_counter() - started) * 1000, faults)

    def _observations(self, ask: ModelRequest) -> Observations:
        """Return what the chef of each row sees in each of the row's states, one after the other."""
        layout = self._layouts[ask.layout]
        players = np.frombuffer(bytearray(ask.players), np.int8).reshape(-1, PLAYERS, 4)
        contents = np.frombuffer(bytearray(ask.contents), np.int8).reshape(-1, layout.width, layout.height)
        counts = [row.states for row in ask.rows]
        left = np.repeat([row.left + row.states - 1 for row in ask.rows], counts)  # of each row's oldest state
        oldest = np.repeat(np.cumsum(counts) - counts, counts)
        every = np.arange(len(players))
        timesteps = (HORIZON - left + every - oldest).astype(np.int32)
        both: Observations = Kitchens(layout, players, contents, timesteps).encode(horizon=HORIZON)
        return np.asarray(both[every, np.repeat([row.seat for row in ask.rows], counts)], np.int8)

    def _follow(self, name: Name, rows: list[Row], chosen: NDArray[np.intp]) -> NDArray[np.intp]:
        """Return the rows whose states follow on what the predictor has seen of their game; the server repeats the
        others."""
        reached = self._predictors[name][1].reached
        follows = [rows[k].fresh or reached.get(rows[k].key) == rows[k].timestep - rows[k].states for k in chosen]
        return chosen[follows]

    def _act(self, name: Name, rows: list[Row], observations: Observations) -> tuple[Probabilities, NDArray[np.int8]]:
        policy, mode = self._agents[name]
        probabilities, usable = usable_rows(policy.probabilities(observations), (len(rows), ACTIONS))
        action_distribution = distribution(probabilities, np.array([row.stuck for row in rows]), mode)
        actions = draw(action_distribution, np.array([row.uniform for row in rows]))
        return action_distribution, np.where(usable, actions, np.int8(-1))

    def _predict(
        self,
        name: Name,
        rows: list[Row],
        newest: NDArray[np.intp],
        observations: Observations,
        actions: NDArray[np.int8],
    ) -> tuple[Predictions, Intentions, NDArray[np.bool_]]:
        """Bring every row's game up to its newest state, one timestep at a time, all rows together. Return also whose
        answers can be used."""
        predictor, games = self._predictors[name]
        slots = np.array([games.slot(row.key) for row in rows], np.intp)
        lengths = np.array([row.states for row in rows])
        fresh = np.array([row.fresh for row in rows])
        if fresh.any():
            predictor.begin(slots[fresh])
        for row in rows:  # until it has answered, its progress is unknown
            games.reached.pop(row.key, None)
        for back in range(int(lengths.max()) - 1, -1, -1):
            reached = lengths > back
            state = newest[reached] - back
            answer = predictor.predict(slots[reached], observations[state], actions[state])
        checked, usable = usable_rows(answer, (len(rows), STEPS, ACTIONS))
        intentions = checked_intentions(predictor, slots, observations[newest], actions[newest])
        games.reached.update((row.key, row.timestep) for row, is_usable in zip(rows, usable, strict=True) if is_usable)
        return checked, intentions, usable


def _refusing(load: Callable[[Name], Loading], name: Name) -> Loading:
    try:
        return load(name)
    except Exception as error:
        raise ModelRefused(f"{name[1]} cannot be used on {name[0]}: {error}") from error


def _by_model(names: list[str | None]) -> Iterator[tuple[str, NDArray[np.intp]]]:
    """Yield each requested model with its rows."""
    for name in dict.fromkeys(names):
        if name is not None:
            yield name, np.flatnonzero([other == name for other in names])


def _start_states(layout: Layout) -> Iterator[Observations]:
    """Start states to try a model on: alone, and eight at once (the first calls of a network are slow)."""
    for games in (1, 8):
        yield Kitchens.start(layout, games).encode(horizon=HORIZON)[:, 0].copy()


def _warm() -> None:
    """Compile the code that every study needs."""
    for _ in _start_states(load_layout("practice")):
        pass
    attention.warm()


def main(descriptor: int) -> None:
    """Serve the connection at `descriptor` until it closes."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C belongs to the server, which closes the connection
    connection = socket.socket(fileno=descriptor)
    inbox = Inbox(connection)
    _warm()  # while the server finds out what its studies need
    first = inbox.wait()
    load = from_server(first[0]) if first else None
    if not isinstance(load, Load):
        return
    try:
        worker = Worker(load)
    except ModelRefused as refused:
        connection.sendall(frame(Failed(str(refused))))
        return
    gc.freeze()  # what is loaded stays: no collection needs to look at it while games wait
    connection.sendall(frame(Loaded(worker.memory, worker.hashes)))
    while bodies := inbox.wait():
        waiting: list[ModelRequest] = []
        for message in map(from_server, bodies):
            if isinstance(message, ModelRequest):
                waiting.append(message)
            elif isinstance(message, Forget):
                _answer(worker, connection, waiting)
                waiting = []
                worker.forget(message.keys)
        _answer(worker, connection, waiting)


def _answer(worker: Worker, connection: socket.socket, asks: list[ModelRequest]) -> None:
    """Answer all received requests for one layout in one batch."""
    for group in group_requests(asks):
        whole = worker.answer(merge_requests(group))
        connection.sendall(b"".join(map(frame, split_answer(whole, group))))


if __name__ == "__main__":
    main(int(sys.argv[1]))
