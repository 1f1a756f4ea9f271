"""Episodes in overcooked_ai's own trajectory format (its JSON form), in and out, so that its tools can read ours.

The format: lists with an entry an episode, `ep_states`, `ep_actions`, `ep_rewards`, `ep_dones` (an entry a timestep),
`ep_returns`, `ep_lengths`, `mdp_params`, `env_params`. A state is written before the joint action that was taken in it.
"""

import json
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Any, TextIO

import numpy as np

from overcooked.constants import COOK_TIME, ITEM_NAMES, ONIONS_PER_SOUP, PLAYERS, STEP_X, STEP_Y
from overcooked.layout import Layout, LayoutError, bundled_layout, parse_layout
from overcooked.score import sparse_reward
from overcooked.state import Kitchens, Record

JointActions = list[list[int]]
Played = tuple[Layout, JointActions]

_DIRECTIONS = [list(step) for step in zip(STEP_X, STEP_Y, strict=True)]
_ACTIONS: list[Any] = [*_DIRECTIONS, [0, 0], "interact"]
_OLD_RULES = {"cook_time": COOK_TIME, "num_items_for_soup": ONIONS_PER_SOUP}
_OLD_FORMAT = (
    "the observation of timestep {} is not a state but what a network saw of it, so that it cannot be compared with "
    'these rules. Write the actions as lines {{"layout": ..., "joint_actions": [[a0, a1], ...]}} into a .jsonl file '
    "and replay that."
)
_ORDERS = [{"ingredients": ["onion"] * ONIONS_PER_SOUP}]


class TrajectoryError(ValueError):
    """Invalid trajectories, or ones that do not follow this kitchen's rules; the message says where."""


def write_trajectories(played: Iterable[Played], file: TextIO) -> int:
    """Write episodes that began in the standard start state; return how many."""
    columns: dict[str, list[Any]] = {}
    count = 0
    for layout, joint_actions in played:
        for name, value in _columns_of(layout, joint_actions).items():
            columns.setdefault(name, []).append(value)
        count += 1
    json.dump(columns, file, separators=(",", ":"))
    return count


def _columns_of(layout: Layout, joint_actions: JointActions) -> dict[str, Any]:
    states, rewards = [], []
    for state, reward in _play(layout, joint_actions):
        states.append(_foreign_state(state))
        rewards.append(reward)
    length = len(joint_actions)
    return {
        "ep_states": states,
        "ep_actions": [[_ACTIONS[action] for action in joint_action] for joint_action in joint_actions],
        "ep_rewards": rewards,
        "ep_dones": [timestep == length - 1 for timestep in range(length)],
        "ep_returns": sum(rewards),
        "ep_lengths": length,
        "mdp_params": {
            "layout_name": layout.name,
            "terrain": [list(row.replace("1", " ").replace("2", " ")) for row in layout.grid],
            "start_player_positions": layout.starts.tolist(),
            "start_bonus_orders": [],
            "start_all_orders": _ORDERS,
            "rew_shaping_params": None,
            "old_dynamics": True,
        },
        "env_params": {"start_state_fn": None, "horizon": length, "info_level": 0, "num_mdp": 1},
    }


def _play(layout: Layout, joint_actions: JointActions) -> Iterator[tuple[Record, int]]:
    """Yield each state with the team's reward of the joint action that was taken in it."""
    kitchen, events = Kitchens.start(layout), np.zeros((1, PLAYERS), np.int32)
    for joint_action in joint_actions:
        state = kitchen.record()
        kitchen.step(np.array([joint_action]), events)
        yield state, sum(sparse_reward(bits) for bits in events[0].tolist())


def _foreign_state(state: Record) -> dict[str, Any]:
    players = [
        {
            "position": [x, y],
            "orientation": _DIRECTIONS[facing],
            "held_object": None if held is None else _foreign_object(held, [x, y]),
        }
        for x, y, facing, held in state["p"]
    ]
    objects = [_foreign_object(item, [x, y]) for x, y, item in state["c"]]
    objects += [_foreign_soup([x, y], onions, tick) for x, y, onions, tick in state["pots"]]
    return {"players": players, "objects": objects, "bonus_orders": [], "all_orders": _ORDERS, "timestep": state["t"]}


def _foreign_object(item: str, position: list[int]) -> dict[str, Any]:
    return (
        _foreign_soup(position, ONIONS_PER_SOUP, COOK_TIME) if item == "soup" else {"name": item, "position": position}
    )


def _foreign_soup(position: list[int], onions: int, tick: int) -> dict[str, Any]:
    return {
        "name": "soup",
        "position": position,
        "_ingredients": [{"name": "onion", "position": position} for _ in range(onions)],
        "cooking_tick": tick,
        "_cooking_tick": tick,
        "is_idle": tick < 0,
        "is_cooking": 0 <= tick < COOK_TIME,
        "is_ready": tick >= COOK_TIME,
        "cook_time": -1 if tick < 0 else COOK_TIME,
    }


def read_trajectories(path: Path) -> Iterator[Played]:
    """Read the episodes of a trajectory file, as `trajectories_in`. Raises OSError for an unreadable file."""
    return trajectories_in(path.read_bytes(), str(path))


def trajectories_in(data: bytes, path: str) -> Iterator[Played]:
    """Read the episodes of parsed trajectories; `path` names them in errors. Every state is re-simulated and compared
    with the file's. Older trajectories have `ep_observations` in place of `ep_states`.

    Raises TrajectoryError for another format or an episode of other rules.
    """
    try:
        columns = json.loads(data)
        states = columns["ep_states" if "ep_states" in columns else "ep_observations"]
        episodes = list(zip(states, columns["ep_actions"], columns["mdp_params"], strict=True))
    except (ValueError, KeyError, TypeError, RecursionError) as error:
        what = f"these are not trajectories of overcooked_ai ({error!r:.80})"
        raise TrajectoryError(f"{path}: {what}. Give a file with `ep_states`, `ep_actions` and `mdp_params`.") from None
    for number, (states, actions, parameters) in enumerate(episodes):
        try:
            yield _checked_episode(states, actions, parameters)
        except (TrajectoryError, LayoutError, FileNotFoundError) as error:
            raise TrajectoryError(f"{path}, episode {number} (from 0): {error}") from None
        except (KeyError, TypeError, ValueError, IndexError, AttributeError) as error:
            what = f"a part is missing or damaged ({error!r:.80}). Copy or write the file again."
            raise TrajectoryError(f"{path}, episode {number} (from 0): {what}") from None


def _checked_episode(states: list[Any], actions: list[Any], parameters: dict[str, Any]) -> Played:
    layout = _layout_of(parameters)
    for rule, value in _OLD_RULES.items():
        if parameters.get(rule, value) != value:
            raise TrajectoryError(f"{rule} is {parameters[rule]!r:.40} there and {value} in these rules")
    if len(states) != len(actions):
        raise TrajectoryError(f"there are {len(states)} states and {len(actions)} joint actions; each state needs one")
    joint_actions = [[_action(action) for action in joint_action] for joint_action in actions]
    if any(len(joint_action) != PLAYERS for joint_action in joint_actions):
        raise TrajectoryError(f"this kitchen has {PLAYERS} chefs")
    for (ours, _), theirs in zip(_play(layout, joint_actions), states, strict=True):
        if not isinstance(theirs, dict):
            raise TrajectoryError(_OLD_FORMAT.format(ours["t"]))
        if ours != _own_state({"timestep": ours["t"], **theirs}, layout):
            hint = "It must begin in the standard start state and be played with old_dynamics=True."
            raise TrajectoryError(f"the state of timestep {ours['t']} does not follow from these rules. {hint}")
    return layout, joint_actions


def _layout_of(parameters: dict[str, Any]) -> Layout:
    """Return the drawn terrain if the file has it, otherwise the bundled layout of that name."""
    name = str(parameters.get("layout_name", "layout"))
    if "terrain" not in parameters:
        return bundled_layout(name)
    rows = [list(row) for row in parameters["terrain"]]
    for player, (x, y) in enumerate(parameters["start_player_positions"], start=1):
        rows[y][x] = str(player)
    try:
        return parse_layout("\n".join("".join(row) for row in rows), name)
    except LayoutError as error:
        raise TrajectoryError(str(error)) from None


def _action(action: Any) -> int:
    known = action.lower() if isinstance(action, str) else action
    if known not in _ACTIONS:
        raise TrajectoryError(f"{action!r:.40} is not an action; actions are {', '.join(map(str, _ACTIONS))}")
    return _ACTIONS.index(known)


def _onions_and_tick(soup: dict[str, Any]) -> tuple[int, int]:
    """Return the onions and the cooking tick (-1: not cooking) of a soup; in the older form its state is [kind, onions,
    tick]."""
    if "_ingredients" in soup:
        return len(soup["_ingredients"]), soup["_cooking_tick"]
    kind, onions, tick = soup["state"]
    if kind != "onion":
        raise TrajectoryError(f"a soup of {kind!r:.40}: in these rules soups are of onions")
    return onions, tick if onions == ONIONS_PER_SOUP else -1


def _own_state(state: dict[str, Any], layout: Layout) -> Record:
    pot_cells = layout.pots.tolist()
    players, counters, pots = [], [], []
    for player in state["players"]:
        held = player["held_object"]
        players.append([*player["position"], _DIRECTIONS.index(player["orientation"]), held and held["name"]])
    for thing in state["objects"]:
        if thing["position"] in pot_cells:
            pots.append([*thing["position"], *_onions_and_tick(thing)])
        else:
            counters.append([*thing["position"], ITEM_NAMES[ITEM_NAMES.index(thing["name"])]])
    return {"t": state["timestep"], "p": players, "c": sorted(counters), "pots": sorted(pots)}
