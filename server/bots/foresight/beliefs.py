"""A simulated participant's beliefs about its partner: from delayed observation, its own guess or the arrows, weighted
by trust. Compiled. A `Memory` is a ring of the last frames as the page received them, by timestep.
"""

from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from overcooked.compiled import kernel
from overcooked.constants import (
    COOKING,
    COUNTER,
    DISH,
    DISH_DISPENSER,
    EXIT,
    FACING,
    HELD,
    INTERACT,
    NOTHING,
    ONION,
    ONION_DISPENSER,
    ONIONS_PER_SOUP,
    POT,
    SOUP,
    STAY,
    X,
    Y,
)
from overcooked.rules import step_game
from server.bots.foresight.kitchen_map import FAR

FRAMES: Final = 16  # a little more than the delay of the slowest participant
AHEAD: Final = 3  # timesteps that a way is planned around the partner
ARROWS_BELIEVED: Final = (3.0, 1.0)  # hits and misses of arrows, as if seen before the game
GUESS_BELIEVED: Final = (1.0, 1.0)  # the same for the own guess
SURE: Final = 0.97  # how much a credulous participant believes an arrow
_EVIDENCE: Final = 3  # timesteps over which a partner's approach is looked at
_BY_DISTANCE: Final = 0.3


class Memory(NamedTuple):
    """The last frames of one game, or of many with the game first."""

    players: NDArray[np.int8]  # (FRAMES, 2, 4)
    contents: NDArray[np.int8]  # (FRAMES, width, height)
    actions: NDArray[np.int64]  # (FRAMES, 2): what led to the frame
    arrows: NDArray[np.int64]  # (FRAMES, 3): predicted actions of the partner shown with it; -1: none


@kernel
def _copy(source, into):
    """Copy a table. A loop compiles ten times faster than an assignment of arrays."""
    for k in range(source.shape[0]):
        for j in range(source.shape[1]):
            into[k, j] = source[k, j]


@kernel
def remember(mind, memory, players, contents, now, actions, arrows):
    """Store a frame. After a gap, or at the start, it also fills the past."""
    fresh = now != mind.now + 1 or mind.now < 0
    for k in range(FRAMES):
        if fresh or k == now % FRAMES:
            _copy(players, memory.players[k])
            _copy(contents, memory.contents[k])
            for seat in range(2):
                memory.actions[k, seat] = STAY if fresh else actions[seat]
            for step in range(memory.arrows.shape[1]):
                memory.arrows[k, step] = arrows[step] if k == now % FRAMES else -1
    if fresh:
        mind.began = mind.seen = mind.partner_hand_since = mind.hand_since = now
        mind.arrow_hits = mind.arrow_count = mind.guess_hits = mind.guess_count = 0
        mind.guess = mind.target = mind.wander = mind.partner_station = -1
        mind.bump_until = mind.wander_until = -1
        mind.blocked = mind.still = 0
    mind.now = now


@kernel
def notice(kitchen, mind, memory):
    """Process the frame that the participant notices now: compare earlier arrows and guesses
    with it, and guess again."""
    other = 1 - mind.seat
    seen = max(mind.began, mind.now - mind.delay)
    if seen > mind.seen:
        done = memory.actions[seen % FRAMES, other]
        arrow = memory.arrows[(seen - 1) % FRAMES, 0]
        if arrow >= 0:
            mind.arrow_hits = mind.forgetting * mind.arrow_hits + (arrow == done)
            mind.arrow_count = mind.forgetting * mind.arrow_count + 1
        if mind.guess >= 0:
            mind.guess_hits = mind.forgetting * mind.guess_hits + (mind.guess == done)
            mind.guess_count = mind.forgetting * mind.guess_count + 1
        if memory.players[seen % FRAMES, other, HELD] != memory.players[(seen - 1) % FRAMES, other, HELD]:
            mind.partner_hand_since = seen
    mind.seen = seen
    mind.partner_station = _station_of_partner(kitchen, mind, memory)
    partner = memory.players[seen % FRAMES, other]
    cell = partner[X] * kitchen.tiles.shape[1] + partner[Y]
    mind.guess = _guessed(kitchen.first, mind, memory.actions, cell, np.int64(partner[FACING]), 0)


@kernel
def pot_needs(pots, contents):
    """Return (onions missing in all pots, pots with a soup that cooks or is ready)."""
    missing = 0
    full = 0
    for k in range(pots.shape[0]):
        inside = contents[pots[k, 0], pots[k, 1]]
        if inside < ONIONS_PER_SOUP:
            missing += ONIONS_PER_SOUP - inside
        else:
            full += 1
    return missing, full


@kernel
def _wanted_by(held, kind, inside, missing, full):
    """Return how likely a chef with this item wants a station, 0 to 1; below 0: not at all."""
    if held == NOTHING:
        if kind == ONION_DISPENSER:
            return 1.0 if missing > 0 else 0.0
        if kind == DISH_DISPENSER:
            return 1.0 if full > 0 else 0.0
        return 0.5 if kind == COUNTER and inside != NOTHING else -1.0
    if held == ONION:
        return 1.0 if kind == POT and inside < ONIONS_PER_SOUP else -1.0
    if held == DISH:
        if kind == POT:
            return 1.0 if inside >= COOKING else 0.0
        return -1.0
    return 1.0 if held == SOUP and kind == EXIT else -1.0


@kernel
def _station_of_partner(kitchen, mind, memory):
    """Return the station that the partner seems to go to; -1: none."""
    now, other = mind.seen, 1 - mind.seat
    before = max(mind.partner_hand_since, now - _EVIDENCE, mind.began)
    here, there = memory.players[now % FRAMES, other], memory.players[before % FRAMES, other]
    contents, height, reach = memory.contents[now % FRAMES], kitchen.tiles.shape[1], kitchen.reach
    missing, full = pot_needs(kitchen.pots, contents)
    here_cell, there_cell = here[X] * height + here[Y], there[X] * height + there[Y]
    best, found = -1e9, -1
    for station in range(kitchen.kind.shape[0]):
        distance = reach[station, here_cell, here[FACING]]
        inside = contents[kitchen.cell[station] // height, kitchen.cell[station] % height]
        wanted = _wanted_by(here[HELD], kitchen.kind[station], inside, missing, full)
        if wanted < 0 or distance >= FAR:
            continue
        score = wanted + reach[station, there_cell, there[FACING]] - distance - _BY_DISTANCE * distance
        if score > best:
            best, found = score, station
    return found


@kernel
def _guessed(first, mind, actions, cell, facing, step):
    """Return the participant's own guess of the partner's action so many steps after the seen frame."""
    if mind.repeats == 1:
        return min(actions[mind.seen % FRAMES, 1 - mind.seat], STAY)
    if mind.partner_station < 0:
        return STAY
    action = first[mind.partner_station, cell, facing]
    return STAY if action == INTERACT and step > 0 else action


@kernel
def arrow_trust(mind):
    """Return the participant's estimate of how often arrows are right."""
    return (mind.arrow_hits + ARROWS_BELIEVED[0]) / (mind.arrow_count + ARROWS_BELIEVED[0] + ARROWS_BELIEVED[1])


@kernel
def guess_trust(mind):
    """Return the participant's estimate of how often its own guess is right."""
    return (mind.guess_hits + GUESS_BELIEVED[0]) / (mind.guess_count + GUESS_BELIEVED[0] + GUESS_BELIEVED[1])


@kernel
def believed_action(first, mind, memory, cell, facing, step):
    """Return (the partner's believed action, its probability) so many steps after the seen frame: the arrow, if one was
    shown with that frame and arrows are trusted; otherwise the own guess. `cell`, `facing`: where the partner is by
    then.
    """
    if step < memory.arrows.shape[1]:
        arrow = memory.arrows[mind.seen % FRAMES, step]
        if arrow >= 0 and (mind.credulous == 1 or arrow_trust(mind) > guess_trust(mind)):
            return arrow, SURE if mind.credulous == 1 else arrow_trust(mind)
    return _guessed(first, mind, memory.actions, cell, facing, step), guess_trust(mind)


@kernel
def imagine_present(kitchen, mind, memory, players, contents):
    """Fill `players` and `contents` with the believed present: the seen frame, continued with the real rules. Returns
    the probability of the partner's position.
    """
    me, other, height = mind.seat, 1 - mind.seat, kitchen.tiles.shape[1]
    _copy(memory.players[mind.seen % FRAMES], players)
    _copy(memory.contents[mind.seen % FRAMES], contents)
    events = np.zeros(2, np.int32)
    sure = 1.0
    for step in range(mind.now - mind.seen):
        cell, facing = players[other, X] * height + players[other, Y], np.int64(players[other, FACING])
        guess, certainty = believed_action(kitchen.first, mind, memory, cell, facing, step)
        own = memory.actions[(mind.seen + step + 1) % FRAMES, me]
        first, second = (own, guess) if me == 0 else (guess, own)
        step_game(kitchen.tiles, kitchen.pots, kitchen.counters, players, contents, first, second, events)
        sure *= certainty
    own_now, theirs = memory.players[mind.now % FRAMES, me], memory.players[mind.seen % FRAMES, other]
    on_me = players[other, X] == own_now[X] and players[other, Y] == own_now[Y]
    for k in range(own_now.shape[0]):
        players[me, k] = own_now[k]  # its own chef is seen at once
        players[other, k] = theirs[k] if on_me else players[other, k]
    return sure


@kernel
def imagine_ahead(kitchen, mind, memory, partner, sure, cells, sures):
    """Fill `cells` (AHEAD + 1,) with where the partner wants to be, and `sures` (AHEAD,) with the probabilities. The
    own chef does not block it here: an arrow into the participant's cell means that the partner wants that cell.
    """
    cell, facing = partner[X] * kitchen.tiles.shape[1] + partner[Y], np.int64(partner[FACING])
    cells[0] = cell
    for step in range(AHEAD):
        action, certainty = believed_action(kitchen.first, mind, memory, cell, facing, mind.now - mind.seen + step)
        if action < STAY:
            facing = action
            cell = kitchen.ahead[cell, action]
        sure *= certainty
        cells[step + 1] = cell
        sures[step] = sure
