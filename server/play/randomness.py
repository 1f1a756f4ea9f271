"""All randomness of an episode: a number for (seed, timestep, purpose); a restarted game draws the same numbers
again.
"""

from functools import lru_cache
from typing import Final

PARTNER: Final = 1  # + seat: draws the agent's action
MARKS: Final = 16  # + step: the random marks of the "random" condition
INTENTION: Final = 24  # the random intention of the "random" condition, by stretch of timesteps
MISLEAD: Final = 32  # at timestep 0: whether the marks of the episode mislead

_MASK = (1 << 64) - 1
_GOLDEN = 0x9E3779B97F4A7C15


def _splitmix64(state: int) -> int:
    """Return one output of SplitMix64 (Steele, Lea and Flood 2014) for the given state."""
    mixed = (state + _GOLDEN) & _MASK
    mixed = ((mixed ^ (mixed >> 30)) * 0xBF58476D1CE4E5B9) & _MASK
    mixed = ((mixed ^ (mixed >> 27)) * 0x94D049BB133111EB) & _MASK
    return mixed ^ (mixed >> 31)


def uniform(seed: int, timestep: int, purpose: int) -> float:
    """Return a number in [0, 1), independent for every (seed, timestep, purpose), the same on every machine."""
    mixed = _splitmix64(_splitmix64(_of_seed(seed) ^ timestep) ^ purpose)
    return (mixed >> 11) * 2.0**-53


@lru_cache(maxsize=4096)
def _of_seed(seed: int) -> int:
    return _splitmix64(seed & _MASK)
