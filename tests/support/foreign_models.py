"""Small agents and predictors that tests load by name, as a researcher's own would be."""

import time

import numpy as np

from models.protocols import INTENTION, INTENTIONS, STEPS, Mode
from overcooked.constants import ACTIONS, NORTH


class Northward:
    """Always north, and says so."""

    def __init__(self, layout):
        self.layout = layout

    def probabilities(self, observations):
        return np.tile(np.eye(ACTIONS, dtype=np.float32)[NORTH], (len(observations), 1))


class EvenHanded:
    """Any action; the random number decides."""

    def __init__(self, layout):
        self.layout = layout

    def probabilities(self, observations):
        return np.full((len(observations), ACTIONS), 1 / ACTIONS, np.float32)


class Jamming(Northward):
    """North, with the anti-jam rule of our own agents."""

    mode = Mode(temperature=0.0, stuck_after=2, stuck_mix=1.0)


class BrokenAfterWarming(EvenHanded):
    """NaN as soon as the games are under way (the first two calls try it)."""

    calls = 0

    def probabilities(self, observations):
        self.calls += 1
        answer = super().probabilities(observations)
        return answer if self.calls <= 2 else answer * np.nan


class SometimesNan(EvenHanded):
    """NaN for the states in which a soup lies somewhere (plane 21)."""

    def probabilities(self, observations):
        answer = super().probabilities(observations)
        answer[(observations[..., 21] > 0).any((1, 2))] = np.nan
        return answer


class WrongShape(EvenHanded):
    def probabilities(self, observations):
        return super().probabilities(observations)[:, :3]


class SlowAfterWarming(EvenHanded):
    """Takes 0.3 s for the first answer after the two calls that warm it up."""

    takes_s = 0.3
    calls = 0

    def probabilities(self, observations):
        self.calls += 1
        if self.calls == 3:
            time.sleep(self.takes_s)
        return super().probabilities(observations)


class VerySlowAfterWarming(SlowAfterWarming):
    """Takes 0.7 s instead, again in each process, like a worker that has to read every game's whole history."""

    takes_s = 0.7


class Hanging(EvenHanded):
    """Never answers about a state whose chef holds a soup somewhere (plane 21)."""

    def probabilities(self, observations):
        while (observations[..., 21] > 0).any():
            time.sleep(0.01)
        return super().probabilities(observations)


class Remembering:
    """Predicts by how many timesteps it has seen of a game, and by all actions in them: history lost is an answer
    changed."""

    memory = 8

    def __init__(self, layout):
        self.seen = {}

    def begin(self, slots):
        for slot in slots.tolist():
            self.seen[slot] = []

    def predict(self, slots, observations, last_actions):
        answer = np.full((len(slots), STEPS, ACTIONS), 0.1, np.float32)
        for row, slot in enumerate(slots.tolist()):
            self.seen[slot] = [*self.seen[slot], *last_actions[row].tolist()][-2 * self.memory :]
            for step in range(STEPS):
                answer[row, step, (sum(self.seen[slot]) + step) % ACTIONS] = 0.5
        return answer


class Planning(Remembering):
    """Also predicts an intention: none, or an onion from the cell whose x is the number of actions that it
    remembers."""

    def intentions(self, slots, observations, last_actions):
        answer = np.zeros((len(slots), INTENTIONS), INTENTION)
        answer[:, 0] = (0, -1, -1, 0, 0.75)
        for row, slot in enumerate(slots.tolist()):
            answer[row, 1] = (1, len(self.seen[slot]) // 4, 2, 5, 0.25)
        return answer


class Overconfident(Remembering):
    """Its actions can be used, its intentions cannot."""

    def intentions(self, slots, observations, last_actions):
        return np.full((len(slots), INTENTIONS), np.array((0, -1, -1, 0, 2.0), INTENTION))


class Slotted:
    """Predicts the action whose number is that of the game's slot, and NaN where a soup lies somewhere (plane 21)."""

    memory = 1

    def __init__(self, layout):
        self.layout = layout

    def begin(self, slots):
        pass

    def predict(self, slots, observations, last_actions):
        answer = np.repeat(np.eye(ACTIONS, dtype=np.float32)[slots % ACTIONS][:, None], STEPS, 1)
        answer[(observations[..., 21] > 0).any((1, 2))] = np.nan
        return answer
