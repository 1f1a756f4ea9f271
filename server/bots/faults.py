"""Run simulated participants under faults: the server is killed, connections break, second tabs open. Then check every
guarantee. Single faults are covered by the tests.
"""

import asyncio
import signal
import time
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

from server.bots.group import BotGroup, GroupOutcome, check_outcome, simulate
from server.bots.local_server import OwnServer
from server.bots.participant import Bot
from server.store.database import Database

BROWSER_FAULTS: Final = ("reload", "second_tab", "half_open")
STATES_BEFORE_THE_KILL: Final = 40  # that each participant has seen, on average
# The guarantees, and the words by which a violation of each is recognised.
GUARANTEES: Final = {
    "nothing that was shown is lost": ("lost timesteps", "is not stored", "is not in the database"),
    "nothing that was shown is changed or doubled": ("in two ways", "as another one", "played twice"),
    "every episode re-simulates to its hashes": ("does not re-simulate",),
    "everybody keeps their condition": ("condition changed", "but played episode"),
    "everybody is shown what their condition requires": ("condition requires",),
    "nobody sees a page twice or loses their place": ("came twice", "a reload led", "a tab that was left"),
    "a code means that everything is stored": ("code",),
    "everybody gets to the end": ("no way on", "ended at timestep", "refused"),
}


@dataclass(frozen=True)
class Trial:
    """The faults that were caused, and their outcome."""

    outcome: GroupOutcome
    faults: dict[str, int]
    away_s: float  # from the kill until pages could be opened again

    def rows(self) -> list[tuple[str, bool, list[str]]]:
        """Return each guarantee, whether it holds, and its violations; the last row has other violations, and faults
        that did not occur."""
        left = list(self.outcome.violations)
        rows = []
        for guarantee, words in GUARANTEES.items():
            mine = [violation for violation in left if any(word in violation for word in words)]
            left = [violation for violation in left if violation not in mine]
            rows.append((guarantee, not mine, mine))
        never = [
            f"no {fault.replace('_', ' ')} happened: give more participants" for fault in FAULTS - set(self.faults)
        ]
        missing = self.outcome.started - self.outcome.completed - self.outcome.dropped
        left += [f"{missing} participants have neither finished nor dropped out"] if missing else []
        rows.append(("every fault occurred, and there was no other violation", not left + never, left + never))
        return rows


FAULTS: Final = {"server_kill", *BROWSER_FAULTS}


async def try_out(group: BotGroup, server: OwnServer, database: Database) -> Trial:
    """Run all participants through the study under faults; the server is killed once, in the middle of the games."""
    everyone: list[Bot] = []
    walking = asyncio.create_task(simulate(group, server.url, database, meet=everyone.extend))
    away_s = await _kill_once(everyone, server, walking)
    bots = await walking
    faults = Counter({"server_kill": 1} if away_s else {})
    for bot in bots:
        faults.update(bot.journal.browser_faults)
    return Trial(check_outcome(bots, database), dict(faults), away_s)


async def _kill_once(everyone: Sequence[Bot], server: OwnServer, walking: "asyncio.Task[list[Bot]]") -> float:
    while sum(len(bot.journal.states) for bot in everyone) < STATES_BEFORE_THE_KILL * max(1, len(everyone)):
        if walking.done():
            return 0.0
        await asyncio.sleep(0.02)
    began = time.monotonic()
    await asyncio.to_thread(server.end, signal.SIGKILL)
    await asyncio.to_thread(server.start)
    return time.monotonic() - began


def table(trial: Trial, seed: int) -> str:
    """Return a table: the faults that were caused, and PASS or FAIL for each guarantee."""
    outcome, faults = trial.outcome, trial.faults
    done = ", ".join(f"{count} x {fault.replace('_', ' ')}" for fault, count in sorted(faults.items()))
    lines = [f"{outcome.started} participants, {outcome.episodes} episodes, seed {seed}", f"faults: {done}"]
    lines.append(f"the server was down for {trial.away_s:.1f} s")
    lines.append("")
    for guarantee, kept, broken in trial.rows():
        lines.append(f"{'PASS' if kept else 'FAIL'}  {guarantee}")
        lines += [f"      {violation}" for violation in broken[:5]]
    return "\n".join(lines)
