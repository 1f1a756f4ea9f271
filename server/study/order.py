"""The order of layouts and agents for one participant. Pure: the same seed and number give the same order."""

import hashlib
import random
from collections.abc import Sequence

from server.study.definition import Study
from server.study.latin_square import balanced_square

Pair = tuple[str, str]  # layout, agent


def derived_seed(*parts: str | int) -> int:
    """Return 63 bits that are determined by the parts, on every machine."""
    text = "\x1f".join(str(part) for part in parts)
    return int.from_bytes(hashlib.sha256(text.encode()).digest()[:8], "big") >> 1


def episode_order(study: Study, seed: int, number: int) -> tuple[Pair, ...]:
    """Return all episodes of a block (without blocks: of the study) of the participant with this seed, the `number`-th
    (from 0) of the study or condition."""
    layouts = [layout.name for layout in study.layouts]
    agents = [agent.name for agent in study.agents]
    rounds = [
        _once(study.order.rule, layouts, agents, derived_seed(seed, "order", turn), number)
        for turn in range(study.order.repeat)
    ]
    return tuple(pair for once in rounds for pair in once)


def _once(rule: str, layouts: list[str], agents: list[str], seed: int, number: int) -> list[Pair]:
    chance = random.Random(seed)  # noqa: S311 - an order, not a secret
    if rule == "paper":
        return _paper(layouts, agents, chance)
    if rule == "shuffled":
        pairs = [(layout, agent) for layout in layouts for agent in agents]
        chance.shuffle(pairs)
        return pairs
    if rule == "latin_square":
        row = balanced_square(len(layouts))[number % len(balanced_square(len(layouts)))]
        turned = [layouts[column] for column in row]
        first = agents if (number // len(layouts)) % 2 == 0 else agents[::-1]
        return _alternating(turned, first)
    return [(layout, agent) for layout in layouts for agent in agents]


def _paper(layouts: list[str], agents: list[str], chance: random.Random) -> list[Pair]:
    """Return the published rule: agents at random in the first layout, then the reverse of the layout before."""
    first = list(agents)
    chance.shuffle(first)
    return _alternating(layouts, first)


def _alternating(layouts: Sequence[str], agents: Sequence[str]) -> list[Pair]:
    return [
        (layout, agent) for turn, layout in enumerate(layouts) for agent in (agents if turn % 2 == 0 else agents[::-1])
    ]
