"""Ask the models about the new states of several games: the games with one deadline in one call."""

import asyncio
import logging
import time
from collections.abc import Sequence
from itertools import islice

from models.protocols import Decision, Models, Question

Answered = tuple[list[Decision | None], float]  # None: no answer in time; the milliseconds that were waited
log = logging.getLogger(__name__)


async def ask_together(models: Models, asked: Sequence[tuple[float, Sequence[Question]]]) -> list[Answered]:
    """Return the decisions of each game. `asked`: its deadline in milliseconds and its questions.

    An answer in time for one study may be late for another. A model that is late costs no other game its answers, but
    the games with the same deadline wait for it.
    """
    answered: list[Answered] = [([], 0.0)] * len(asked)
    alike: dict[float, list[int]] = {}  # by deadline: places in `asked`
    for place, (deadline_ms, questions) in enumerate(asked):
        if questions:
            alike.setdefault(deadline_ms, []).append(place)

    async def ask(deadline_ms: float, places: list[int]) -> None:
        began = time.perf_counter()
        decisions = iter(await _decisions(models, [one for place in places for one in asked[place][1]], deadline_ms))
        waited_ms = (time.perf_counter() - began) * 1000
        for place in places:
            answered[place] = list(islice(decisions, len(asked[place][1]))), waited_ms

    await asyncio.gather(*(ask(*group) for group in alike.items()))
    return answered


async def _decisions(models: Models, questions: Sequence[Question], deadline_ms: float) -> Sequence[Decision | None]:
    try:
        return await models.ask(questions, deadline_ms)
    except Exception:
        log.exception("the models failed; %d partners wait", len(questions))
        return [None] * len(questions)
