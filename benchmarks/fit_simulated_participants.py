"""Fit the simulated participants to recorded games of people, without arrows.

    python benchmarks/fit_simulated_participants.py               checks the frozen parameters: fit and held-out games
    python benchmarks/fit_simulated_participants.py --search 60   tries so many others, from the frozen ones on
    python benchmarks/fit_simulated_participants.py --write       also writes fit_simulated_participants.json

Only facts of the recordings count (tests/data, five classic kitchens, 150 ms a timestep): shares of timesteps without a
key and with an interaction, collisions, soups, the rhythm of keys, and the likelihood of the recorded actions. Pairs of
simulated participants are compared with pairs of people. Every second recorded game is held out. Tries are stored in
--folder, and a search continues from there.
"""

import argparse
import gzip
import json
import math
import sys
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parent.parent
# `training.py` next to this file has the name of a package: remove this folder from the module search path.
sys.path[:] = [str(ROOT), *(folder for folder in sys.path if Path(folder).resolve() != ROOT / "benchmarks")]

import numpy as np  # noqa: E402
from numpy.typing import NDArray  # noqa: E402

from overcooked.constants import FLOOR, INTERACT, PLAYERS, SOUP_DELIVERY, STAY, STEP_X, STEP_Y  # noqa: E402
from overcooked.layout import Layout, load_layout  # noqa: E402
from overcooked.state import Kitchens  # noqa: E402
from server.bots.foresight.participants import NO_ARROW, SimulatedParticipants  # noqa: E402
from server.bots.foresight.people import ARROWS, FITTED, VERSION, Parameters, Variant, described, person  # noqa: E402

KITCHENS = ("cramped_room", "asymmetric_advantages", "coordination_ring", "forced_coordination", "counter_circuit")
RECORDED_TICK_MS = 150.0
FIGURES = Path(__file__).with_suffix(".json")
TIMESTEPS = 400
# The difference in logarithms that counts one point; collisions first.
SCALES = {"stay": 0.1, "interact": 0.15, "collisions": 0.1, "soups": 0.12, "rest_after_rest": 0.15}
SIMULATED = 40  # pairs in each kitchen, with which a parameter set is evaluated
NATS = 0.02  # of the mean likelihood count one point
# What is searched, and by how much a try changes it: the standard deviation of the logarithm.
SEARCHED = {
    "act_after_action": 0.1, "act_after_rest": 0.1, "pause": 0.3, "pause_s": 0.3, "collision": 0.4, "in_the_way": 0.4,
    "bump_cost": 0.4, "detour": 0.3, "caution_s": 0.3, "temperature": 0.25, "effort": 0.3, "onion_ahead": 0.3,
    "doubt": 0.4, "still_there": 0.2, "slip": 0.4,
    "boredom_s": 0.3, "dish_ahead": 0.3, "dish": 0.15, "keep": 0.05, "yields": 0.3,
    "while_waiting": 0.3,
}  # fmt: skip
AT_MOST = {
    "detour": 1.0,
    "doubt": 1.0,
    "still_there": 1.0,
    "keep": 1.0,
    "yields": 1.0,
    "pause": 0.95,
    "while_waiting": 1.0,
}


@dataclass(frozen=True)
class Recorded:
    """Games of two people on one layout, all cut to the same length."""

    layout: Layout
    players: NDArray[np.int8]  # (timesteps + 1, games, 2, 4)
    contents: NDArray[np.int8]  # (timesteps + 1, games, width, height)
    actions: NDArray[np.int64]  # (timesteps, games, 2)
    soups: NDArray[np.float64]  # (games,)

    def some(self, games: slice) -> "Recorded":
        return replace(
            self,
            players=self.players[:, games],
            contents=self.contents[:, games],
            actions=self.actions[:, games],
            soups=self.soups[games],
        )


@cache
def recorded(name: str) -> Recorded:
    """Read the recorded games of a kitchen."""
    layout = load_layout(name)
    kitchen, games = Kitchens.start(layout), []
    with gzip.open(ROOT / "tests" / "data" / f"{name}_train.jsonl.gz", "rt", encoding="utf-8") as lines:
        for record in map(json.loads, lines):
            if record["k"] == "ep":
                games.append(([], [], [], []))
            elif record["k"] == "s":
                kitchen.restore(record)
                players, contents, actions, points = games[-1]
                players.append(kitchen.players[0].copy())
                contents.append(kitchen.contents[0].copy())
                if "a" in record:
                    actions.append(record["a"])
                    points.append(record.get("r", 0.0))
    length = min(min(len(game[0]) - 1, len(game[2])) for game in games)
    return Recorded(
        layout,
        np.stack([game[0][: length + 1] for game in games], 1),
        np.stack([game[1][: length + 1] for game in games], 1),
        np.stack([np.array(game[2][:length], np.int64) for game in games], 1),
        np.array([sum(game[3][:length]) / 5 for game in games]),
    )


def facts(games: Recorded) -> dict[str, float]:
    """Return what is compared: shares of timesteps, and numbers a game of 400 timesteps."""
    actions, layout = games.actions, games.layout
    here, there = games.players[:-1, ..., :2], games.players[1:, ..., :2]
    step_x, step_y = np.array([*STEP_X, 0, 0]), np.array([*STEP_Y, 0, 0])
    tiles = layout.tiles[here[..., 0] + step_x[actions], here[..., 1] + step_y[actions]]
    collided = ((actions < STAY) & (tiles == FLOOR) & (here == there).all(-1)).any(-1)
    rests, scale = actions == STAY, TIMESTEPS / len(actions)
    return {
        "stay": float(rests.mean()),
        "interact": float((actions == INTERACT).mean()),
        "collisions": float(collided.sum(0).mean() * scale),
        "soups": float(games.soups.mean() * scale),
        "rest_after_rest": float((rests[1:] & rests[:-1]).sum() / max(1, rests[:-1].sum())),
    }


def simulated(name: str, parameters: Parameters, games: int, seed: int, tick_ms: float = RECORDED_TICK_MS) -> Recorded:
    """Let pairs of simulated participants play."""
    layout, variant = load_layout(name), Variant(parameters=parameters)
    kitchens, events = Kitchens.start(layout, games), np.zeros((games, PLAYERS), np.int32)
    pairs = [
        SimulatedParticipants(
            layout, [person(seed + PLAYERS * game + seat, seat, variant, tick_ms) for game in range(games)]
        )
        for seat in range(PLAYERS)
    ]
    actions, none = np.full((games, PLAYERS), STAY, np.int64), np.full((games, ARROWS), NO_ARROW)
    players, contents, done, soups = [kitchens.players.copy()], [kitchens.contents.copy()], [], np.zeros(games)
    for _ in range(TIMESTEPS):
        actions = np.stack([one.act(kitchens, actions, none) for one in pairs], 1)
        kitchens.step(actions, events)
        players.append(kitchens.players.copy())
        contents.append(kitchens.contents.copy())
        done.append(actions)
        soups += ((events & SOUP_DELIVERY) != 0).sum(1)
    return Recorded(layout, np.stack(players), np.stack(contents), np.stack(done), soups)


def nats(games: Recorded, parameters: Parameters, timesteps: int) -> float:
    """Return the mean cross-entropy (nats) at the recorded actions, each given the recorded past."""
    layout, variant = games.layout, Variant(parameters=parameters)
    count, total = games.actions.shape[1], 0.0
    none = np.full((count, ARROWS), NO_ARROW)
    for seat in range(PLAYERS):
        mind = SimulatedParticipants(layout, [person(game, seat, variant, RECORDED_TICK_MS) for game in range(count)])
        before = np.full((count, PLAYERS), STAY, np.int64)
        for timestep in range(timesteps):
            now = Kitchens(
                layout, games.players[timestep], games.contents[timestep], np.full(count, timestep, np.int32)
            )
            mind.act(now, before, none)
            before = games.actions[timestep]
            total -= float(np.log(np.maximum(mind.probabilities[np.arange(count), before[:, seat]], 1e-6)).sum())
    return total / (count * PLAYERS * timesteps)


def compared(
    parameters: Parameters, games: slice, number: int, seed: int, timesteps: int
) -> dict[str, dict[str, dict[str, float]]]:
    """Return kitchen -> people and simulated -> facts, with the cross-entropy of what people did."""
    found = {}
    for name in KITCHENS:
        people = recorded(name).some(games)
        found[name] = {
            "people": facts(people),
            "simulated": facts(simulated(name, parameters, number, seed)),
            "likelihood": {"nats": nats(people, parameters, min(timesteps, len(people.actions)))},
        }
    return found


def loss(found: Mapping[str, Mapping[str, Mapping[str, float]]]) -> float:
    """Return how far simulated pairs are from people: 0 would be no difference at all."""
    total = 0.0
    for cell in found.values():
        for fact, scale in SCALES.items():
            if cell["people"][fact] > 0:
                total += (math.log((cell["simulated"][fact] + 0.02) / (cell["people"][fact] + 0.02)) / scale) ** 2
        total += cell["likelihood"]["nats"] / NATS
    return total / len(found)


def tries(number: int, folder: Path) -> Iterator[tuple[float, Parameters]]:
    """Search: each try changes some of the best parameters so far; yield every improvement."""
    folder.mkdir(parents=True, exist_ok=True)
    kept = sorted(folder.glob("*.json"))
    best, least = FITTED, math.inf
    for path in kept:
        stored = json.loads(path.read_text(encoding="utf-8"))
        if stored["loss"] < least:
            best, least = parameters_of(stored["parameters"]), stored["loss"]
    for count in range(len(kept), number):
        draws = np.random.default_rng(count)
        changed = best if count == 0 else changed_at_random(best, draws)
        found = compared(changed, slice(0, None, 2), SIMULATED, 1000, 150)
        value = loss(found)
        stored = {"loss": value, "parameters": described(changed), "found": found}
        (folder / f"{count:04}.json").write_text(json.dumps(stored, indent=1), encoding="utf-8")
        if value < least:
            best, least = changed, value
            yield value, best


def changed_at_random(parameters: Parameters, draws: np.random.Generator) -> Parameters:
    names = [name for name in SEARCHED if draws.random() < 0.4] or ["collision"]
    values: dict[str, Any] = {}
    for name in names:
        now, factor = getattr(parameters, name), math.exp(draws.normal(0, SEARCHED[name]))
        both = now if isinstance(now, tuple) else (now,)
        changed = tuple(float(f"{min(one * factor, AT_MOST.get(name, math.inf)):.3g}") for one in both)
        values[name] = changed if isinstance(now, tuple) else changed[0]
    return replace(parameters, **values)


def parameters_of(stored: Mapping[str, Any]) -> Parameters:
    """Return the inverse of `described`."""
    return Parameters(**{name: tuple(one) if isinstance(one, list) else one for name, one in stored.items()})


def main() -> None:
    parser = argparse.ArgumentParser(
        allow_abbrev=False, description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--search", type=int, default=0, metavar="N", help="number of parameter sets to try")
    parser.add_argument("--folder", type=Path, default=ROOT / "runs" / "foresight_fit", help="what was tried")
    parser.add_argument("--write", action="store_true", help=f"write {FIGURES.relative_to(ROOT)}")
    parser.add_argument("--quick", action="store_true", help="few short games: rough figures that are not stored")
    arguments = parser.parse_args()
    if arguments.quick and arguments.write:
        parser.error("--quick measures too little to be stored: leave out --write.")
    for value, best in tries(arguments.search, arguments.folder):
        print(f"loss {value:.2f}", json.dumps(described(best)), flush=True)
    number, timesteps = (2, 20) if arguments.quick else (120, 100_000)
    figures = {
        part: compared(FITTED, slice(first, None, 2), number, 50_000, timesteps)
        for first, part in enumerate(("fitted games", "held-out games"))
    }
    for part, found in figures.items():
        print(f"{part}: loss {loss(found):.2f}")
        for name, cell in found.items():
            print(f"  {name}, cross-entropy {cell['likelihood']['nats']:.3f} nats an action")
            for fact in SCALES:
                print(f"    {fact:<16} people {cell['people'][fact]:7.3f}   simulated {cell['simulated'][fact]:7.3f}")
    if arguments.write:
        FIGURES.write_text(
            json.dumps(figures | {"version": VERSION, "parameters": described(FITTED)}, indent=1) + "\n",
            encoding="utf-8",
        )


if __name__ == "__main__":
    main()
