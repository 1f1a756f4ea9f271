"""Traits of simulated participants: the fitted parameters of all, and one person drawn from them.

All times are in milliseconds or per second, so that the same person plays at any length of a timestep.
"""

from dataclasses import dataclass, field, fields
from random import Random
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

VERSION: Final = 2  # of the participants and their parameters; decision 22 says what changed
MAX_DELAY: Final = 14  # timesteps; two fewer than the frames that a participant remembers (beliefs.FRAMES)
TICK_MS: Final = 200.0  # the platform's timestep; recorded games of people have 150 ms
ARROWS: Final = 3  # how many predicted actions a page shows


@dataclass(frozen=True)
class Parameters:
    """Parameters of all participants, chosen without looking at any difference between conditions (decision 22)."""

    # Searched by benchmarks/fit_simulated_participants.py on recorded games of people, who had no arrows (Carroll et
    # al. 2019; five kitchens, every second game).
    act_after_action: float = 3.7  # actions per second directly after an action
    act_after_rest: float = 4.1  # actions per second after a timestep without one
    pause: float = 0.423  # chance to rest right after the hand changed
    pause_s: float = 0.178  # how fast that chance falls
    while_waiting: float = 0.15  # share of these rates that is left while the target is of no use yet, or there is none
    collision: float = 7.69  # timesteps that a collision is worth
    in_the_way: float = 3.16  # timesteps that standing in the partner's way is worth
    doubt: float = 0.0801  # how much it minds that the partner may not be where it believes
    still_there: float = 0.429  # chance that the partner is then where it was seen, and not in a cell next to that
    bump_cost: float = 6.0  # timesteps that a cell in which one was just blocked is worth avoiding
    detour: float = 0.33  # how much of a way around the partner is counted
    caution_s: float = 1.18  # how long a cell in which one was blocked is avoided
    temperature: float = 0.406  # timesteps: how much better a way must be to be taken
    slip: tuple[float, float] = (0.00958, 0.0383)  # chance of a random key
    effort: float = 0.225  # timesteps that pressing a key is worth
    onion_ahead: float = 0.22  # value of an onion that is not needed yet; a needed one is 1
    dish: float = 1.63  # value of a dish that is needed
    dish_ahead: float = 0.0699  # value of one that is not
    keep: float = 0.721  # the old target stays while it has this share of the best one's value
    yields: float = 0.411  # chance to make way while resting
    boredom_s: tuple[float, float] = (0.785, 1.37)  # after this long without any effect, it walks elsewhere
    # The best of eight that were tried on the same facts.
    delays_ms: tuple[float, ...] = (200.0, 200.0, 300.0, 450.0)  # until others are noticed, one drawn
    # Set by hand, not fitted.
    spread: float = 0.15  # of the rates of keys between people: standard deviation of the logarithm
    patience_s: tuple[float, float] = (0.4, 0.8)  # after this long in front of an obstacle, it tries a random move
    forgetting: float = 0.97  # weight of the past at each hit or miss of arrows and own guesses


FITTED: Final = Parameters()


@dataclass(frozen=True)
class Variant:
    """Modified participants, for sensitivity checks and for `--cook credulous`."""

    credulous: bool = False  # arrows are always believed
    delay: int | None = None  # timesteps, for everybody
    repeats: bool | None = None  # own guess: "repeats the last move" (True) or "walks to the inferred station" (False)
    parameters: Parameters = field(default=FITTED)


MIND: Final = np.dtype(
    [
        # the person
        ("seed", "u8"), ("seat", "i8"), ("delay", "i8"), ("repeats", "i8"), ("credulous", "i8"),
        ("act_after_action", "f8"), ("act_after_rest", "f8"), ("pause", "f8"), ("pause_kept", "f8"),
        ("while_waiting", "f8"),
        ("collision", "f8"), ("in_the_way", "f8"), ("caution", "i8"), ("bump_cost", "f8"),
        ("detour", "f8"), ("doubt", "f8"), ("still_there", "f8"), ("temperature", "f8"), ("slip", "f8"),
        ("effort", "f8"), ("onion_ahead", "f8"), ("dish", "f8"), ("dish_ahead", "f8"), ("keep", "f8"),
        ("yields", "f8"), ("patience", "i8"), ("boredom", "i8"), ("forgetting", "f8"),
        # the game so far; times are timesteps
        ("began", "i8"), ("now", "i8"), ("seen", "i8"), ("arrow_hits", "f8"), ("arrow_count", "f8"),
        ("guess_hits", "f8"), ("guess_count", "f8"), ("guess", "i8"), ("partner_station", "i8"),
        ("partner_hand_since", "i8"), ("target", "i8"), ("hand_since", "i8"), ("acted", "i8"), ("blocked", "i8"),
        ("bump", "i8"), ("bump_until", "i8"), ("still", "i8"), ("wander", "i8"),
        ("wander_until", "i8"),
    ]
)  # fmt: skip

_AS_THEY_ARE: Final = (
    "collision", "in_the_way", "temperature", "effort", "onion_ahead", "dish", "dish_ahead", "keep", "yields",
    "forgetting", "pause", "while_waiting", "bump_cost", "detour", "doubt", "still_there",
)  # fmt: skip


def person(seed: int, seat: int, variant: Variant, tick_ms: float = TICK_MS) -> NDArray[np.void]:
    """Draw the person of this seed at the start of a game: an array of one `MIND`."""
    chance, made, mind = Random(f"person {seed}"), variant.parameters, np.zeros(1, MIND)  # noqa: S311
    tick_s = tick_ms / 1000
    delay = chance.choice(made.delays_ms)
    pace = float(np.exp(chance.gauss(0, made.spread)))
    drawn: dict[str, Any] = {
        "seed": seed & (2**63 - 1),
        "seat": seat,
        "delay": variant.delay if variant.delay is not None else min(MAX_DELAY, max(1, round(delay / tick_ms))),
        "repeats": chance.random() < 0.5,
        "credulous": variant.credulous,
        "act_after_action": min(0.97, made.act_after_action * pace * tick_s),
        "act_after_rest": min(0.97, made.act_after_rest * pace * tick_s),
        "pause_kept": float(np.exp(-tick_s / max(made.pause_s, 1e-3))),
        "caution": round(made.caution_s / tick_s),
        "slip": chance.uniform(*made.slip),
        "patience": max(2, round(chance.uniform(*made.patience_s) / tick_s)),
        "boredom": max(2, round(chance.uniform(*made.boredom_s) / tick_s)),
    }
    if variant.repeats is not None:
        drawn["repeats"] = variant.repeats
    for name, value in drawn.items():
        mind[name] = value
    for name in _AS_THEY_ARE:
        mind[name] = getattr(made, name)
    mind["now"], mind["bump"] = -1, -1
    return mind


def described(parameters: Parameters) -> dict[str, Any]:
    """Return the parameters by name, as plain data."""
    return {one.name: getattr(parameters, one.name) for one in fields(parameters)}
