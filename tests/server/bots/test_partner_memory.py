"""Bots with limited sight decide from the messages to the page, and remember the partner as a person would."""

import numpy as np
import pytest

from overcooked.constants import STAY
from overcooked.layout import load_layout
from overcooked.state import Kitchens
from server.bots.cook import CookName, Traits
from server.bots.foresight.cook import cook
from server.bots.partner_memory import PartnerMemory
from server.play.limited_sight import Sight
from server.play.messages import KitchenState

LAYOUT = load_layout("double_rings")
FAR, FARTHER = (7, 1, 0, 3), (7, 3, 1, 0)


def seen(partner: tuple[int, int, int, int], own: tuple[int, int, int, int] = (1, 1, 0, 0)) -> Kitchens:
    """A state as the server masks it: a partner out of view has the place of the own chef."""
    kitchens = Kitchens.start(LAYOUT)
    kitchens.players[0] = np.array([own, partner], np.int8)
    return kitchens


def masked(own: tuple[int, int, int, int] = (1, 1, 0, 0)) -> Kitchens:
    return seen((own[0], own[1], 0, 0), own)


def partner(kitchens: Kitchens) -> tuple[int, ...]:
    return tuple(kitchens.players[0, 1].tolist())


def test_a_partner_out_of_view_is_where_it_was_seen_last() -> None:
    memory = PartnerMemory(LAYOUT, 0, radius=2)
    assert partner(memory.complete(seen((3, 1, 2, 3)), True)) == (3, 1, 2, 3)
    assert partner(memory.complete(masked(own=(1, 3, 1, 0)), False))[2:] == (2, 3), "what it holds is remembered"
    away = masked(own=(7, 1, 0, 0))
    assert partner(memory.complete(away, False)) == (3, 1, 2, 3)


def test_a_partner_is_not_taken_to_be_where_the_view_shows_nobody() -> None:
    memory = PartnerMemory(LAYOUT, 0, radius=2)
    memory.complete(seen((3, 1, 2, 3)), True)
    x, y, *_ = partner(memory.complete(masked(), False))
    assert max(abs(x - 1), abs(y - 1)) > 2
    assert LAYOUT.tiles[x, y] == 0


def test_a_partner_that_was_never_seen_is_somewhere_out_of_view_with_empty_hands() -> None:
    x, y, _, held = partner(PartnerMemory(LAYOUT, 0, radius=2).complete(masked(), False))
    assert max(abs(x - 1), abs(y - 1)) > 2
    assert held == 0


@pytest.mark.parametrize("kind", ["foresight", "credulous", "planner"])
def test_events_out_of_view_change_no_action(kind: CookName) -> None:
    """Two kitchens that look alike in the view of two cells: the same person does the same in both."""
    done = []
    for partner_place, pots in ((FAR, ()), (FARTHER, ((6, 0, 3, 7),))):
        sight, memory = Sight(LAYOUT, 0, 2), PartnerMemory(LAYOUT, 0, 2)
        bot = cook(LAYOUT, 0, Traits.drawn(3, kind), 11)
        for t in range(12):
            state = KitchenState(t=t, players=((1, 1, 0, 0), partner_place), counters=(), pots=pots, score=0, soups=0)
            sight.look(state)
            kitchens = Kitchens.start(LAYOUT)
            shown = sight.masked(state)
            kitchens.players[0] = np.array(shown.players, np.int8)
            kitchens.timestep[0] = t
            assert shown.pots == ()
            mind = memory.complete(kitchens, sight.sees_partner(state))
            done.append(bot.act(mind, 0, (STAY, STAY), (), 400))
    assert done[:12] == done[12:]
