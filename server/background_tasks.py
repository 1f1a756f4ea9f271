"""End tasks of the event loop."""

import asyncio
from typing import Any, Final

_ASK_AGAIN_S: Final = 0.2


async def ended(*tasks: "asyncio.Task[Any] | None") -> None:
    """Cancel the tasks and return when they are over, whatever they raise. One request may not be enough:
    `asyncio.wait_for` of Python 3.11 loses a cancellation that arrives at the moment when the awaited task finishes,
    and Redis' client uses it for every command.
    """
    left = {task for task in tasks if task is not None}
    while left:
        for task in left:
            task.cancel()
        over, left = await asyncio.wait(left, timeout=_ASK_AGAIN_S)
        await asyncio.gather(*over, return_exceptions=True)  # mark their exceptions as retrieved
