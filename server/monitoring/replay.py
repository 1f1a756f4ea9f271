"""One stored or running episode, simulated again from its actions; every state is compared with its stored hash."""

import json
import time
from collections.abc import Sequence
from contextlib import suppress
from typing import Any, Final

from msgspec import structs
from sqlalchemy import Connection

from overcooked.constants import EVENT_NAMES
from overcooked.layout import parse_layout
from server.play.recorder import MARKS, EpisodeRecord, InputRecord, PauseRecord, TickRecord
from server.play.simulation import Simulation
from server.store import episodes, inputs, interactions, ticks
from server.store.accuracy import wilson
from server.store.database import Database, DatabaseDown
from server.store.episodes import BrokenEpisode

_BREATHE_EVERY: Final = 16  # timesteps between which the live games' thread can run


def record_json(connection: Connection, episode: str, blind: bool) -> str:
    """Return the record as JSON. Raises BrokenEpisode, LayoutError."""
    loaded = episodes.load(connection, episode)
    if loaded is None:
        raise BrokenEpisode(
            f"There is no episode {episode}. Its participant may have withdrawn: open it from the list of games."
        )
    stored = ticks.of_episode(connection, episode)
    rows, difference = simulate(loaded, stored, blind)
    spec, held = loaded.spec, episodes.pauses_of(connection, episode)
    found = {
        "game": {
            "episode": episode,
            "kind": spec.kind,
            "grid": parse_layout(spec.grid, spec.layout).grid,
            "title": spec.title,
            "seat": spec.human_seats[0] if spec.human_seats else -1,
            "watched_seat": spec.watched_seat,
            "people": len(spec.human_seats),
            "horizon": spec.horizon,
            "tick_ms": spec.tick_ms,
            "deadline_ms": spec.deadline_ms,
            "show": "always" if blind else spec.show,
            "display": "none" if blind or spec.shown == "nothing" else spec.display,
            "view_radius": 0 if blind else spec.view_radius,
        },
        "status": loaded.status,
        "rows": rows,
        "pauses": [pause_of(pause) for pause in held],
        "inputs": [input_of(one, spec.tick_ms, held) for one in visible(inputs.of_episode(connection, episode), blind)],
        "checked": {"states": len(stored), "equal": difference is None, "difference": difference},
        "accuracy": [] if blind else _accuracy(stored, spec.watched_seat),
        "intention_accuracy": None if blind else _intention_accuracy(connection, episode),
    }
    return json.dumps(found, separators=(",", ":"))


def simulate(loaded: EpisodeRecord, stored: list[TickRecord], blind: bool) -> tuple[list[dict[str, Any]], str | None]:
    """Return a row for each stored tick, and the first difference between the rules and the record (None: all are
    equal)."""
    simulation = Simulation(parse_layout(loaded.spec.grid, loaded.spec.layout), loaded.spec.horizon)
    rows: list[dict[str, Any]] = []
    difference = None
    for tick in stored:
        if tick.timestep % _BREATHE_EVERY == 0:
            time.sleep(0)
        if tick.actions is not None:
            step = simulation.step(tick.actions)
            if difference is None and (step.rewards, step.events) != (tick.rewards, tick.events):
                difference = f"timestep {tick.timestep}: other rewards or events than stored"
        if difference is None and simulation.hash() != tick.state_hash:
            difference = (
                f"timestep {tick.timestep}: the state's hash is {simulation.hash()}, stored is {tick.state_hash}"
            )
        rows.append(row_of(tick, simulation, blind))
    return rows, difference


def row_of(tick: TickRecord, simulation: Simulation, blind: bool) -> dict[str, Any]:
    """Return one tick for the page; `simulation` is at its state."""
    kitchen = simulation.kitchen()
    return {
        "t": tick.timestep,
        "state": {name: getattr(kitchen, name) for name in ("t", "players", "counters", "pots", "score", "soups")},
        "actions": tick.actions,
        "rewards": tick.rewards,
        "events": [_names(bits) for bits in tick.events],
        "prediction": [] if blind else [[round(value, 4) for value in step] for step in tick.prediction],
        "displayed": [] if blind else tick.displayed,
        "intentions": [] if blind else [structs.asdict(one) for one in tick.intentions],
        "displayed_intention": None if blind else tick.displayed_intention,
        "asked": None if blind else tick.asked,
        "misleading": None if blind else tick.misleading,
        "keys": [[key.seat, key.seq, round(key.received_ms)] for key in tick.keys],
        "late": tick.late,
        "late_ms": round(tick.late_ms, 1),
        "models_ms": round(tick.models_ms, 1),
        "scheduled_ms": tick.scheduled_ms,
    }


def pause_of(one: PauseRecord) -> dict[str, Any]:
    """Return one pause for the page. `seat`: whose absence began it; None: nobody's, or not known."""
    return {"t": one.timestep, "reason": one.reason, "duration_ms": one.duration_ms, "seat": one.seat}


def visible(arrived: Sequence[InputRecord], blind: bool) -> list[InputRecord]:
    """Return the inputs that the page may show: the marks key would reveal the condition to a blind researcher."""
    if not blind:
        return list(arrived)
    return [structs.replace(one, marks=None) for one in arrived if one.outcome != MARKS]


def input_of(one: InputRecord, tick_ms: int, held: Sequence[PauseRecord] = ()) -> dict[str, Any]:
    """Return one input for the page. `t`: the timestep in which it counted, otherwise the one in which it arrived."""
    if one.timestep is not None:
        t = one.timestep - 1
    elif one.received_ms is not None:
        t = max(0, int(one.received_ms // tick_ms))
    else:  # the game was paused: use the state of the last pause that had begun
        begun = [pause.timestep for pause in held if pause.started_at.timestamp() * 1000 <= one.received_unix_ms]
        t = begun[-1] if begun else 0
    keys = {"seat": one.seat, "seq": one.seq, "held": one.held, "tap": one.tap, "marks": one.marks}
    return {"t": t, **keys, "outcome": one.outcome, "received_ms": one.received_ms}


def _names(bits: int) -> list[str]:
    return [name for bit, name in enumerate(EVENT_NAMES) if bits >> bit & 1]


def _accuracy(stored: list[TickRecord], seat: int) -> list[dict[str, Any]]:
    """Return for each step how often the likeliest action happened, with its interval."""
    rows = []
    for step in range(3):
        pairs = [
            (max(range(6), key=tick.prediction[step].__getitem__), stored[n + step + 1].actions)
            for n, tick in enumerate(stored)
            if tick.prediction and n + step + 1 < len(stored)
        ]
        right = sum(1 for predicted, done in pairs if done is not None and done[seat] == predicted)
        share, low, high = wilson(right, len(pairs))
        rows.append({"share": round(share, 4), "low": round(low, 4), "high": round(high, 4), "n": len(pairs)})
    return rows


def _intention_accuracy(connection: Connection, episode: str) -> dict[str, Any] | None:
    """Return how often the likeliest intention came, with its interval; None without intentions."""
    asked, right = interactions.hits_of(connection, episode)
    if not asked:
        return None
    share, low, high = wilson(right, asked)
    return {"share": round(share, 4), "low": round(low, 4), "high": round(high, 4), "n": asked}


class StoredTicks:
    """Reads the ticks of a game that another process plays, as they are stored."""

    def __init__(self, database: Database, episode: str) -> None:
        self._database, self._episode = database, episode
        self._simulation: Simulation | None = None

    async def new_rows(self, blind: bool) -> list[dict[str, Any]]:
        """Return the newest tick at the first call, then all new ones; none while the database cannot be reached."""
        with suppress(DatabaseDown):
            return await self._database.read(self._read, blind)
        return []

    def _read(self, connection: Connection, blind: bool) -> list[dict[str, Any]]:
        if self._simulation is None:
            loaded = episodes.load(connection, self._episode)
            if loaded is None or loaded.last_hash is None:
                return []
            self._simulation = Simulation(parse_layout(loaded.spec.grid, loaded.spec.layout), loaded.spec.horizon)
            for actions in loaded.joint_actions:
                self._simulation.step(actions)
            newest = ticks.of_episode(connection, self._episode, after=self._simulation.timestep - 1)
            return [row_of(newest[0], self._simulation, blind)]
        rows = []
        for tick in ticks.of_episode(connection, self._episode, after=self._simulation.timestep):
            if tick.actions is not None:
                self._simulation.step(tick.actions)
            rows.append(row_of(tick, self._simulation, blind))
        return rows
