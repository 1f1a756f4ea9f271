"""A partner whose goals come from a language model, and that never waits for it.

A language model takes seconds, a timestep has 200 ms. So the two run side by side: the model is asked in the background
what to do next in a situation (what the chef holds, how full the pots are), and the chef acts on the last plan there
is. If there is no plan yet, or the model cannot be reached, it falls back to a simple rule.

    export LLM_URL=http://127.0.0.1:11434/v1  LLM_MODEL=llama3.2  LLM_API_KEY=...
    cd docs/examples && kitchenmind agent serve language_model_partner:LanguageModelPartner --port 9000

Any endpoint with the chat completions of OpenAI's API works. The key is optional and is sent to that address only.
"""

import os
import threading
import time
from collections import OrderedDict

import httpx
import numpy as np

from models.agents.observation_parser import ParsedObservation, certain, distances, parse_observation
from overcooked.constants import DISH, INTERACT, ITEM_NAMES, NOTHING, ONION, SOUP, STAY, STEP_X, STEP_Y

GOALS = {
    "onion": "fetch an onion",
    "dish": "fetch a dish",
    "fill": "put the onion into a pot",
    "plate": "take the soup out of a pot with the dish",
    "serve": "serve the soup",
    "counter": "put down what you hold",
    "wait": "step aside and wait",
}
POSSIBLE = {
    NOTHING: ("onion", "dish", "wait"),
    ONION: ("fill", "counter", "wait"),
    DISH: ("plate", "counter", "wait"),
    SOUP: ("serve", "counter", "wait"),
}
SYSTEM = (
    "You are a chef in a kitchen with another chef. A pot takes 3 onions, then cooks for 20 steps. A ready soup is "
    "taken out with a dish and served. Serve as many soups as you can. Answer with one word: the name of your goal."
)
ANSWER_TIMEOUT_S = 20.0
REST_S = (1.0, 30.0)  # after a failure: at first, and at most
MAX_PLANS = 500


class LanguageModelPartner:
    """One for each kitchen; plays any number of games in it."""

    def __init__(self, layout):
        self.layout = layout
        self.plans = OrderedDict()  # situation -> goal
        self.latest = {}  # what is held -> the last goal that the model chose for it
        self.failures = 0
        self._wanted = None  # the newest situation without a plan: older ones are no longer worth asking about
        self._news = threading.Condition()
        self._http = httpx.Client(timeout=ANSWER_TIMEOUT_S)
        self._is_closed = False
        self._thread = threading.Thread(target=self._plan_forever, daemon=True)
        self._thread.start()

    def close(self):
        """Ask nothing more."""
        with self._news:
            self._is_closed = True
            self._news.notify()
        self._thread.join()
        self._http.close()

    def probabilities(self, observations):
        """Return what to do now (games, 6). Looks plans up and never waits for one."""
        return np.stack([certain(self._action(parse_observation(planes))) for planes in observations])

    def _action(self, seen):
        situation = describe(seen)
        goal = self.plans.get(situation)
        if goal is None:
            self._ask(seen.held, situation)
            goal = self.latest.get(seen.held) or usual_goal(seen)
        return action_towards(seen, places_of(goal, seen))

    def _ask(self, held, situation):
        with self._news:
            self._wanted = (held, situation)
            self._news.notify()

    def _plan_forever(self):
        while True:
            with self._news:
                self._news.wait_for(lambda: self._is_closed or self._wanted is not None)
                if self._is_closed:
                    return
                held, situation = self._wanted
                self._wanted = None
            try:
                goal = self._answer_of_the_model(held, situation)
            except (httpx.HTTPError, ValueError, KeyError, IndexError, TypeError) as error:
                self.failures += 1
                print(f"the language model gave no plan ({error!r}); the last plan holds", flush=True)
                time.sleep(min(REST_S[1], REST_S[0] * 2 ** min(self.failures - 1, 10)))
                continue
            self.failures = 0
            self.latest[held] = goal
            self.plans[situation] = goal
            while len(self.plans) > MAX_PLANS:
                self.plans.popitem(last=False)

    def _answer_of_the_model(self, held, situation):
        choices = "\n".join(f"{name}: {GOALS[name]}" for name in POSSIBLE[held])
        key = os.environ.get("LLM_API_KEY", "")
        answer = self._http.post(
            os.environ.get("LLM_URL", "http://127.0.0.1:11434/v1").rstrip("/") + "/chat/completions",
            headers={"Authorization": f"Bearer {key}"} if key else {},
            json={
                "model": os.environ.get("LLM_MODEL", "llama3.2"),
                "messages": [
                    {"role": "system", "content": SYSTEM},
                    {"role": "user", "content": f"{situation}\nYour goals:\n{choices}"},
                ],
                "temperature": 0,
                "max_tokens": 20,
            },
        )
        words = answer.raise_for_status().json()["choices"][0]["message"]["content"].lower()
        at = {name: words.find(name) for name in POSSIBLE[held] if name in words}
        if not at:
            raise ValueError(f"it names none of the goals: {words[:60]!r}")
        return min(at, key=at.get)


def describe(seen: ParsedObservation) -> str:
    """Return the situation in words, without positions: situations that need the same goal have the same words."""
    names = ["nothing" if name is None else name for name in ITEM_NAMES]
    pots = sorted("a soup is ready" if pot.left == 0 else "a soup cooks" if pot.left else f"{pot.onions} onions"
                  for pot in seen.pots)  # fmt: skip
    lying = sorted(names[item] for item in seen.items.values())
    return (
        f"You hold {names[seen.held]}, the other chef holds {names[seen.other_held]}. Pots: {', '.join(pots)}. "
        f"On the counters: {', '.join(lying) or 'nothing'}."
    )


def usual_goal(seen: ParsedObservation) -> str:
    """Return the goal of a cook without a plan."""
    if seen.held == SOUP:
        return "serve"
    if seen.held == DISH:
        return "plate"
    wants_onions = any(pot.left is None for pot in seen.pots)
    if seen.held == ONION:
        return "fill" if wants_onions else "counter"
    is_cooking = any(pot.left is not None for pot in seen.pots)
    return "dish" if is_cooking and seen.other_held != DISH else "onion" if wants_onions else "wait"


def places_of(goal: str, seen: ParsedObservation) -> tuple:
    """Return the cells that serve a goal, none if the chef should wait."""
    lying = {item: tuple(cell for cell, here in seen.items.items() if here == item) for item in (ONION, DISH)}
    return {
        "onion": seen.onions + lying[ONION],
        "dish": seen.dishes + lying[DISH],
        "fill": tuple(pot.cell for pot in seen.pots if pot.left is None),
        "plate": tuple(pot.cell for pot in seen.pots if pot.left is not None),
        "serve": seen.exits,
        "counter": seen.free_counters,
        "wait": (),
    }[goal]


def action_towards(seen: ParsedObservation, cells: tuple) -> int:
    """Return the next action on the shortest way to one of the cells, around the other chef if there is one."""
    for blocked in (seen.other, None):
        reached = distances(seen.floor, seen.me, blocked)
        ways = [
            (reached[near][0], direction, cell)
            for cell in cells
            for direction in range(4)
            if (near := (cell[0] - STEP_X[direction], cell[1] - STEP_Y[direction])) in reached
        ]
        if ways:
            steps, direction, cell = min(ways)
            if steps:
                return reached[cell[0] - STEP_X[direction], cell[1] - STEP_Y[direction]][1]
            is_cooking = any(pot.cell == cell and pot.left for pot in seen.pots)
            return direction if seen.facing != direction else STAY if is_cooking else INTERACT
    return STAY
