"""Choose the condition of the next participant. Pure: counts come from the database, random numbers from the study's
seed.
"""

import random
from collections.abc import Mapping
from dataclasses import dataclass

from server.study.definition import Condition, Study
from server.study.order import derived_seed


@dataclass(frozen=True)
class Count:
    """The number of participants with a place in a condition, without those who dropped out, withdrew, timed out or
    were screened out."""

    completed: int = 0
    active: int = 0

    @property
    def held(self) -> int:
        return self.completed + self.active


class StudyFullError(Exception):
    """Every condition has reached its quota."""


def next_condition(
    study: Study,
    counts: Mapping[str, Count],
    number: int,
    of_all_versions: Mapping[str, Count] | None = None,
    unpaired: Mapping[str, int] | None = None,
) -> str:
    """Return the condition of the participant who is the `number`-th (from 0) to consent.

    Of the conditions below their quota, the one whose held places are fewest for its weight; equal ones are drawn by
    the study's seed and `number`. So places that dropouts leave are filled first. `counts`: the places of this version,
    within which conditions take turns: one that a new version adds does not get everybody who comes next.
    `of_all_versions`: those that a quota counts, if there are earlier versions. Raises StudyFullError.

    `unpaired`: in a study with rounds of two people, how many in each condition have not met a partner yet. Where that
    number is odd, somebody waits for one more: these conditions come first.
    """
    filled = counts if of_all_versions is None else of_all_versions
    open_ones = [condition for condition in study.conditions if not _is_full(condition, filled)]
    if not open_ones:
        raise StudyFullError(study.name)
    open_ones = [one for one in open_ones if (unpaired or {}).get(one.name, 0) % 2] or open_ones
    # The share with one more participant: for weights 1 and 2 the places are taken 2, 1, 2, 2, 1, 2 ...
    share = {
        condition.name: (counts.get(condition.name, Count()).held + 1) / condition.weight for condition in open_ones
    }
    fewest = min(share.values())
    candidates = [name for name, value in share.items() if value == fewest]
    return random.Random(derived_seed(study.seed, "condition", number)).choice(candidates)  # noqa: S311 - no secret


def participant_seed(study: Study, number: int) -> int:
    """Return the seed of the participant who is the `number`-th to consent, which determines order and episodes."""
    return derived_seed(study.seed, "participant", number)


def _is_full(condition: Condition, counts: Mapping[str, Count]) -> bool:
    return condition.quota is not None and counts.get(condition.name, Count()).held >= condition.quota
