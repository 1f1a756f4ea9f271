"""One timestep of a simulated participant: from the frames received to the probabilities of its next key. Compiled. All
randomness comes from the person's seed and the timestep: the same frames lead to the same actions.
"""

from typing import Final

import numpy as np

from overcooked.compiled import kernel
from overcooked.constants import ACTIONS, COUNTER, DISH, FACING, HELD, NOTHING, POT, STAY, X, Y
from server.bots.foresight.beliefs import (
    AHEAD,
    FRAMES,
    Memory,
    imagine_ahead,
    imagine_present,
    notice,
    remember,
)
from server.bots.foresight.kitchen_map import FAR
from server.bots.foresight.route import action_costs, soft_choice
from server.bots.foresight.tasks import choose_target, ticks_to_wait, what_is_inside

DRAW, WANDER = 201, 202  # purposes of chance
_WANDERS: Final = 8  # timesteps that a bored participant walks elsewhere, at most
_AWAY: Final = 3  # ticks to the place where it walks, at least
_TRIES: Final = 0.5  # chance of a random move while blocked
_USE_AND_LEAVE: Final = 2  # ticks that somebody who faces a station needs the cell in front of it


@kernel
def _mixed(state):
    """Return one output of SplitMix64, as `server.play.randomness` has it."""
    mixed = state + np.uint64(0x9E3779B97F4A7C15)
    mixed = (mixed ^ (mixed >> np.uint64(30))) * np.uint64(0xBF58476D1CE4E5B9)
    mixed = (mixed ^ (mixed >> np.uint64(27))) * np.uint64(0x94D049BB133111EB)
    return mixed ^ (mixed >> np.uint64(31))


@kernel
def chance(seed, timestep, purpose):
    """Return a number in [0, 1), independent for every (seed, timestep, purpose): `server.play.randomness.uniform`."""
    mixed = _mixed(_mixed(_mixed(np.uint64(seed)) ^ np.uint64(timestep)) ^ np.uint64(purpose))
    return (mixed >> np.uint64(11)) * 2.0**-53


@kernel
def _feel(ahead, mind, memory, height):
    """Update the mind from the own chef: whether the last key had an effect, and which chef was in the way."""
    now, me = mind.now, mind.seat
    own, before = memory.players[now % FRAMES, me], memory.players[(now - 1) % FRAMES, me]
    action = memory.actions[now % FRAMES, me]
    mind.acted = action != STAY
    stood = own[X] == before[X] and own[Y] == before[Y]
    if own[HELD] != before[HELD]:
        mind.hand_since = now
    if not stood or own[HELD] != before[HELD]:
        mind.still = 0
    elif mind.acted:
        mind.still += 1
    if action < STAY:
        cell = before[X] * height + before[Y]
        bumped = stood and ahead[cell, action] != cell
        mind.blocked = mind.blocked + 1 if bumped else 0
        if bumped:
            mind.bump, mind.bump_until = ahead[cell, action], now + mind.caution


@kernel
def _wander_to(kitchen, mind, cell, facing, held, inside):
    """Return a random place at least `_AWAY` ticks off; with something in the hand an empty counter."""
    found, count = -1, 0
    for station in range(kitchen.kind.shape[0]):
        distance = kitchen.reach[station, cell, facing]
        free = kitchen.kind[station] == COUNTER and inside[station] == NOTHING
        if distance < _AWAY or distance >= FAR or (held != NOTHING and not free):
            continue
        count += 1
        if chance(mind.seed, mind.now * 64 + station, WANDER) < 1.0 / count:
            found = station
    return found


@kernel
def _target_now(kitchen, mind, players, contents, inside, cell):
    """Return the current target: a random place if bored, otherwise the task's station."""
    facing, held = players[mind.seat, FACING], players[mind.seat, HELD]
    if mind.wander >= 0:
        arrived = kitchen.reach[mind.wander, cell, facing] == 0 and held == NOTHING
        if arrived or mind.now >= mind.wander_until:
            mind.wander = -1
    waits = mind.target >= 0 and kitchen.kind[mind.target] == POT and held == DISH
    if mind.wander < 0 and mind.still >= mind.boredom and not waits:
        mind.wander = _wander_to(kitchen, mind, cell, facing, held, inside)
        mind.wander_until = mind.now + _WANDERS
        mind.still = 0
    if mind.wander < 0:
        mind.target = choose_target(kitchen, mind, players, contents, inside)
    return mind.wander if mind.wander >= 0 else mind.target


@kernel
def _ticks_until_turn(kitchen, mind, inside, target, me, partner, held):
    """Return the ticks until the partner has used the target and left, 0 if there is no need to wait.

    If the partner seems to be on its way to the same station and can use it at once, and only one cell is next to that,
    a participant who is not nearer waits. `me`, `partner`: (cell, facing); `held`: by the partner.
    """
    if target < 0 or target != mind.partner_station or kitchen.shared[target] == 1:
        return 0
    theirs, own = kitchen.reach[target, partner[0], partner[1]], kitchen.reach[target, me[0], me[1]]
    first = theirs <= own and ticks_to_wait(kitchen.kind[target], inside[target], held) <= theirs
    return theirs + _USE_AND_LEAVE if first else 0


@kernel
def _limits(mind, waits, wanted_by_partner, chosen, out):
    """Fill `out` with the chosen action's probabilities after rests, slips, and random moves while blocked.

    `waits`: nothing useful can be done yet. `wanted_by_partner` (0-1): how sure the partner wants the own cell next;
    then one does not rest there as often.
    """
    acts = mind.act_after_action if mind.acted == 1 else mind.act_after_rest
    acts *= 1.0 - mind.pause * mind.pause_kept ** (mind.now - mind.hand_since)
    acts *= mind.while_waiting if waits else 1.0
    acts += (1.0 - acts) * mind.yields * wanted_by_partner
    tries = _TRIES if mind.blocked >= mind.patience else 0.0
    for action in range(ACTIONS):
        wanted = (1 - tries) * chosen[action] + (tries / STAY if action < STAY else 0.0)
        out[action] = acts * ((1 - mind.slip) * wanted + mind.slip / ACTIONS)
    out[STAY] += 1 - acts


@kernel
def think(kitchen, mind, memory, players, contents, now, actions, arrows, out):
    """Fill `out` (6,) with the probabilities of the participant's action on this state.

    `players` (2, 4), `contents` (width, height), `now` the timestep, `actions` (2,) what led to the state, `arrows`
    (3,) the predicted actions of the partner shown with it (-1: none). Changes `mind` and `memory`.
    """
    remember(mind, memory, players, contents, now, actions, arrows)
    _feel(kitchen.ahead, mind, memory, contents.shape[1])
    notice(kitchen, mind, memory)
    believed, imagined = np.empty((2, 4), np.int8), np.empty(contents.shape, np.int8)
    sure = imagine_present(kitchen, mind, memory, believed, imagined)
    cells, sures = np.empty(AHEAD + 1, np.int64), np.empty(AHEAD)
    imagine_ahead(kitchen, mind, memory, believed[1 - mind.seat], sure, cells, sures)
    inside = np.empty(kitchen.kind.shape[0], np.int64)
    what_is_inside(kitchen, imagined, inside)
    me = believed[mind.seat]
    cell, facing = me[X] * contents.shape[1] + me[Y], np.int64(me[FACING])
    target = _target_now(kitchen, mind, believed, imagined, inside, cell)
    wait = ticks_to_wait(kitchen.kind[target], inside[target], me[HELD]) if target >= 0 else 0
    other = believed[1 - mind.seat]
    partner = (cells[0], np.int64(other[FACING]))
    wait = max(wait, _ticks_until_turn(kitchen, mind, inside, target, (cell, facing), partner, other[HELD]))
    costs, chosen = np.empty(ACTIONS), np.empty(ACTIONS)
    seen = memory.players[mind.seen % FRAMES, 1 - mind.seat]
    seen_cell = seen[X] * contents.shape[1] + seen[Y]
    action_costs(kitchen, mind, (cell, facing), target, wait, seen_cell, cells, sures, costs)
    soft_choice(costs, mind.temperature, chosen)
    waits = target < 0 or wait > kitchen.reach[target, cell, facing]
    _limits(mind, waits, sures[0] if cells[1] == cell else 0.0, chosen, out)


@kernel
def drawn(mind, probabilities):
    """Draw the action with the person's random numbers."""
    threshold = chance(mind.seed, mind.now, DRAW)
    reached = 0.0
    for action in range(ACTIONS):
        reached += probabilities[action]
        if threshold < reached:
            return action
    return STAY


@kernel
def think_all(kitchen, minds, memory, players, contents, now, actions, arrows, probabilities, out):
    """Do the same as `think` for many games at the same timestep, and draw: `probabilities` (games, 6), `out` (games,)
    actions. All arrays have the game first."""
    for game in range(minds.shape[0]):
        mind = minds[game]
        own = Memory(memory.players[game], memory.contents[game], memory.actions[game], memory.arrows[game])
        think(kitchen, mind, own, players[game], contents[game], now, actions[game], arrows[game], probabilities[game])
        out[game] = drawn(mind, probabilities[game])
