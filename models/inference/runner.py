"""Run the live game's models in worker processes, batched over games, with a deadline. This is the server side: no
torch here. Our own models share workers; every agent or predictor from outside has a separate worker, so that a slow
one delays only itself.
"""

import asyncio
import zlib
from collections import Counter, deque
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from models.agents.blackbox import is_foreign
from models.agents.model_paths import ModelPaths
from models.inference.launch import Launched
from models.inference.partial_answer import PartialAnswer, read_answer
from models.inference.supervised_worker import ModelsDown, SupervisedWorker
from models.inference.wire import APART, Answer, Load, Name, Row
from models.protocols import Decision, History, Question
from overcooked.constants import PLAYERS

__all__ = ["ModelServer", "ModelStatistics", "ModelsDown"]

_Part = tuple[list[SupervisedWorker], str | None, str | None]  # any of these workers; its agent, its predictor

HANG_S = 1.0
_KEPT_TIMES = 2000


@dataclass(frozen=True)
class ModelStatistics:
    """Counts of late, failed and restarted models since the start of the server, and times in ms."""

    restarts: int  # workers replaced
    late: int  # questions without an answer by their deadline (a worker that was too slow, or not there)
    faults: dict[str, int]  # "layout/model: reason" -> how often
    model_ms: tuple[float, float, float]  # a worker's time for one batch: median, 99 %, most


class ModelServer:
    """The `Models` of the live game. `start`, then `ask` from the event loop, `close` at the end.

    `agents` and `predictors` are (layout, name) pairs, each name as the catalogue or a foreign model is called; a
    question about any other is not answered. `grids`: layouts that are not bundled, name -> grid. `ahead`: a worker's
    process that has been launched already; used if there are models of our own, and then ended with the others.
    `paths`, to be set before `start`: where models with relative paths are.
    """

    def __init__(
        self,
        agents: Sequence[Name],
        predictors: Sequence[Name],
        workers: int = 1,
        hang_s: float = HANG_S,
        grids: Mapping[str, str] | None = None,
        ahead: Launched | None = None,
    ) -> None:
        self.paths = ModelPaths()
        self._first = (agents, predictors, dict(grids or {}))
        self._workers, self._hang_s, self._ahead = workers, hang_s, ahead
        self._pool: list[SupervisedWorker] = []
        self._agents: dict[Name, list[SupervisedWorker]] = {}  # any of them answers
        self._predictors: dict[Name, list[SupervisedWorker]] = {}  # `random` is an agent and a predictor
        self._routes: dict[tuple[str, str | None, str | None], list[_Part]] = {}  # by layout, agent, predictor
        self._seats: dict[str, set[int]] = {}
        self._adding = asyncio.Lock()  # two that want the same models must not both load them
        self._late = 0
        self._faults: Counter[str] = Counter()
        self._times: deque[float] = deque(maxlen=_KEPT_TIMES)

    async def start(self) -> None:
        """Load and warm every model. Raises ModelsDown with the name and the reason; nothing is left running then."""
        for load in _loads(*self._first, self.paths):
            self._take_in(load, self._pool_for(load, self._ahead))
        started = await asyncio.gather(*(worker.start() for worker in self._pool), return_exceptions=True)
        errors = [outcome for outcome in started if isinstance(outcome, BaseException)]
        if errors:
            await self.close()
            raise errors[0]

    def has(self, agents: Sequence[Name], predictors: Sequence[Name]) -> bool:
        """Return whether all of these are loaded."""
        return self._agents.keys() >= set(agents) and self._predictors.keys() >= set(predictors)

    async def add(
        self, agents: Sequence[Name], predictors: Sequence[Name], grids: Mapping[str, str], paths: ModelPaths
    ) -> None:
        """Load what is not loaded yet, in separate workers, while the others continue to answer. Raises ModelsDown;
        then nothing has changed."""
        async with self._adding:
            await self._add(agents, predictors, grids, paths)

    async def _add(
        self, agents: Sequence[Name], predictors: Sequence[Name], grids: Mapping[str, str], paths: ModelPaths
    ) -> None:
        new = [name for name in agents if name not in self._agents]
        watching = [name for name in predictors if name not in self._predictors]
        made = [(load, self._pool_for(load)) for load in _loads(new, watching, grids, paths)]
        pool = [worker for _, some in made for worker in some]
        started = await asyncio.gather(*(worker.start() for worker in pool), return_exceptions=True)
        errors = [outcome for outcome in started if isinstance(outcome, BaseException)]
        if errors:
            await asyncio.gather(*(worker.close() for worker in pool))
            raise errors[0]
        for load, some in made:
            self._take_in(load, some)

    async def drop(self, layout: str) -> None:
        """End the workers that have the models of a layout. Only for a layout whose models were added on their own."""
        ended: set[SupervisedWorker] = set()
        for pools in (self._agents, self._predictors):
            for name in [name for name in pools if name[0] == layout]:
                ended.update(pools.pop(name))
        self._pool = [worker for worker in self._pool if worker not in ended]
        self._routes.clear()
        await asyncio.gather(*(worker.close() for worker in ended))

    def _pool_for(self, load: Load, ahead: Launched | None = None) -> list[SupervisedWorker]:
        if any(is_foreign(name) for _, name in (*load.agents, *load.predictors)):
            return [SupervisedWorker(load, 1, self._hang_s)]
        numbers = range(self._workers)
        return [
            SupervisedWorker(load, int(number == 0), self._hang_s, ahead if number == 0 else None) for number in numbers
        ]

    def _take_in(self, load: Load, pool: list[SupervisedWorker]) -> None:
        """Send questions about these models to these workers from now on."""
        self._pool += pool
        self._agents |= dict.fromkeys(load.agents, pool)
        self._predictors |= dict.fromkeys(load.predictors, pool)
        self._routes.clear()

    async def close(self) -> None:
        """End every worker."""
        await asyncio.gather(*(worker.close() for worker in self._pool))

    async def ask(self, questions: Sequence[Question], deadline_ms: float) -> list[Decision | None]:
        """Return one decision per question; None if no answer came within `deadline_ms` or the model failed."""
        batches = self._send(questions, deadline_ms / 1000)
        futures = [answer for _, answer in batches]
        if futures:
            await asyncio.wait(futures, timeout=deadline_ms / 1000)
        found = [PartialAnswer() for _ in questions]
        for chosen, answer in batches:
            if answer.done() and not answer.cancelled():
                self._read([found[k] for k in chosen], answer.result())
            else:
                answer.cancel()
                self._late += len(chosen)
        return [part.decision(question) for part, question in zip(found, questions, strict=True)]

    def forget(self, game: str) -> None:
        """Free the memory of a game that is over."""
        keys = [_key(game, seat) for seat in self._seats.pop(game, ())]
        for worker in self._pool:
            worker.forget(keys)

    def statistics(self) -> ModelStatistics:
        times = np.array(self._times) if self._times else np.zeros(1)
        median, high, most = np.quantile(times, (0.5, 0.99, 1.0)).tolist()
        restarts = sum(worker.restarts for worker in self._pool)
        return ModelStatistics(restarts, self._late, dict(self._faults), (median, high, most))

    @property
    def ready(self) -> bool:
        """Whether every model can be asked now."""
        return all(worker.pid for worker in self._pool)

    def worker_pids(self) -> list[int]:
        """Return the process ids of the workers that answer now (without spares)."""
        return [worker.pid for worker in self._pool if worker.pid]

    @staticmethod
    def _one_of(pool: list[SupervisedWorker], game: str) -> SupervisedWorker:
        """Choose one of several workers, always the same one for a game."""
        return pool[0] if len(pool) == 1 else pool[zlib.crc32(game.encode()) % len(pool)]

    def _send(
        self, questions: Sequence[Question], patience_s: float
    ) -> "list[tuple[list[int], asyncio.Future[Answer]]]":
        """Ask each worker about each layout once; return what was asked: indices of questions, answer to come."""
        alike: dict[tuple[str, str | None, str | None], list[int]] = {}  # of one layout, agent and predictor
        for k, question in enumerate(questions):
            alike.setdefault((question.layout, question.agent, question.predictor), []).append(k)
        groups: dict[tuple[SupervisedWorker, str], list[tuple[int, str | None, str | None]]] = {}
        for asked, places in alike.items():
            for pool, agent, predictor in self._parts(*asked):
                for k in places:
                    worker = self._one_of(pool, questions[k].game)
                    groups.setdefault((worker, asked[0]), []).append((k, agent, predictor))
        sent = []
        for (worker, layout), parts in groups.items():
            chosen = [k for k, _, _ in parts]
            if worker.ready(patience_s):
                rows, histories = self._rows(worker, questions, parts)
                sent.append((chosen, worker.ask(layout, rows, histories, patience_s)))
            else:
                self._late += len(chosen)
        return sent

    def _parts(self, layout: str, agent: str | None, predictor: str | None) -> "list[_Part]":
        """Return the pools that answer: one for agent and predictor together, or two."""
        asked = (layout, agent, predictor)
        if asked not in self._routes:
            self._routes[asked] = self._route(*asked)
        return self._routes[asked]

    def _route(self, layout: str, agent: str | None, predictor: str | None) -> "list[_Part]":
        """Return the pool of each model that is asked; one part for both where they share a pool."""
        pools: list[_Part] = []
        if agent is not None and (layout, agent) in self._agents:
            pools.append((self._agents[layout, agent], agent, None))
        if predictor is not None and (layout, predictor) in self._predictors:
            pool = self._predictors[layout, predictor]
            if pools and pools[0][0] is pool:
                return [(pool, agent, predictor)]
            pools.append((pool, None, predictor))
        return pools

    def _rows(
        self,
        worker: SupervisedWorker,
        questions: Sequence[Question],
        parts: list[tuple[int, str | None, str | None]],
    ) -> tuple[list[Row], list[History]]:
        """Return what a worker is sent about these questions; it counts as sent from now on."""
        rows, histories = [], []
        for k, agent, predictor in parts:
            question = questions[k]
            key = _key(question.game, question.seat)
            missing = 1 if predictor is None else worker.missing(key, question.timestep)
            if not missing:
                self._seats.setdefault(question.game, set()).add(question.seat)
            history = question.history(missing or worker.memory)
            rows.append(
                Row(
                    key=key,
                    agent=agent,
                    predictor=predictor,
                    timestep=question.timestep,
                    states=len(history.actions) // PLAYERS,
                    fresh=not missing,
                    stuck=question.stuck,
                    uniform=question.uniform,
                    seat=question.seat,
                    left=question.left,
                )
            )
            histories.append(history)
            if predictor is not None:
                worker.saw(key, question.timestep)
        return rows, histories

    def _read(self, found: list[PartialAnswer], answer: Answer) -> None:
        self._times.append(answer.model_ms)
        self._faults.update(f"{fault.model}: {fault.reason}" for fault in answer.faults)
        read_answer(found, answer)


def _loads(
    agents: Sequence[Name], predictors: Sequence[Name], grids: Mapping[str, str], paths: ModelPaths
) -> list[Load]:
    """Return what workers load: all models of our own together, every foreign one alone."""
    models = (*agents, *predictors)
    groups = [[name for name in models if not is_foreign(name[1])]]
    foreign = dict.fromkeys(name for _, name in models if is_foreign(name))
    groups += [[pair for pair in models if pair[1] == name] for name in foreign]
    return [
        Load(
            tuple(name for name in agents if name in group),
            tuple(name for name in predictors if name in group),
            dict(grids),
            {"/".join(name): paths.located(name[0].partition(APART)[0], name[1]) for name in group},
            paths.folders,
        )
        for group in groups
        if group
    ]


def _key(game: str, seat: int) -> str:
    return f"{game}/{seat}"
