"""A person at the keyboard of a real game page: reads the page's socket, and presses keys like a planner."""

import json
import time
from contextlib import suppress

import msgspec
from playwright.sync_api import Page, TimeoutError, WebSocket

from kitchenmind.client.seen_kitchen import SeenKitchen
from models.agents.planner import PlannerPolicy
from overcooked.constants import STAY
from server.play import messages

KEYS = ("ArrowUp", "ArrowDown", "ArrowRight", "ArrowLeft", "", "Space")
LOOK_MS = 15
PRESS_AGAIN_S = 2.0  # a key without effect, e.g. during a pause
SILENCE_S = 0.5  # without a timestep for this long, it looks for a button that continues the game
BUTTON_MS = 2000.0
BUTTONS = ("start-button", "pause-button")
_decoder = msgspec.json.Decoder(messages.Outgoing)


class BrowserCook:
    """Watches a page from before it opens its first game. It presses one key, then waits for its effect: even on a slow
    machine it never acts on a state from before its last key."""

    def __init__(self, page: Page) -> None:
        self.page = page
        self.timesteps: list[int] = []  # of the ticks of the current episode, as they came
        self.predictions: list[tuple[tuple[int, int], ...]] = []
        self.ended: list[messages.Ended] = []
        self._ends_seen = 0  # by `play`: a short game can be over before `play` is called
        self.paused: list[str] = []
        self.episode = ""
        self._kitchen: SeenKitchen | None = None
        self._policy = PlannerPolicy()
        self._fresh = False
        self._lesson = ""
        self._applied = self._sent = -1
        self._pressed = 0.0  # when, if the page has not sent it yet
        self._heard = 0.0  # when the last timestep came
        page.on("websocket", self._attach)

    def _attach(self, socket: WebSocket) -> None:
        if socket.url.partition("?")[0].endswith("/socket"):  # not the one with which the consent page tries the line
            self._applied = self._sent = -1
            socket.on("framereceived", self._receive)
            socket.on("framesent", self._note)

    def _note(self, frame: str | bytes) -> None:
        message = json.loads(frame)
        if message["type"] == "input" and message["tap"] is not None:
            self._sent, self._pressed = message["seq"], 0.0

    def _receive(self, frame: str | bytes) -> None:
        match message := _decoder.decode(frame):
            case messages.Welcome():
                if message.episode != self.episode:
                    self.timesteps, self.predictions = [], []
                self.episode, self._kitchen, self._lesson = message.episode, SeenKitchen(message), ""
            case messages.Tick() if self._kitchen is not None:
                self._kitchen.show(message.state)
                self.timesteps.append(message.state.t)
                self.predictions.append(message.prediction)
                self._fresh, self._applied, self._heard = True, message.applied, time.monotonic()
            case messages.Lesson():
                self._lesson = "" if message.done else message.key
            case messages.Paused():
                self.paused.append(message.reason)
                self._sent = -1
            case messages.Ended():
                self.ended.append(message)

    def play(self, until_timestep: int = 10**9, seconds: float = 150.0) -> None:
        """Play until the episode is over, or has come so far; start it, and end its pauses, as a participant would."""
        deadline = time.monotonic() + seconds
        while len(self.ended) == self._ends_seen and (not self.timesteps or self.timesteps[-1] < until_timestep):
            assert time.monotonic() < deadline, f"the game got stuck at timestep {self.timesteps[-1:]}"
            self.page.wait_for_timeout(LOOK_MS)
            if time.monotonic() - self._heard > SILENCE_S:
                self._push_shown_button()
            pending = time.monotonic() - self._pressed < PRESS_AGAIN_S
            if self._fresh and not pending and self._applied >= self._sent and self._kitchen is not None:
                self._act(self._kitchen)
        self._ends_seen = len(self.ended)

    def _act(self, kitchen: SeenKitchen) -> None:
        self._fresh = False
        action = 5 if self._lesson == "marks" else kitchen.decide(self._policy)
        if action != STAY:
            self._pressed = time.monotonic()
            self._press(action)

    def _press(self, action: int) -> None:
        self.page.keyboard.press(KEYS[action])

    def _push_shown_button(self) -> None:
        """Push the button that the page shows, if any. A slow machine can lose the line at any moment, so that the
        start becomes a pause: a button that has gone by the time it is pushed is none to wait for."""
        for name in BUTTONS:
            if self.page.is_visible(f"#{name}"):
                with suppress(TimeoutError):
                    self._push(name)
                self._heard = time.monotonic()

    def _push(self, button: str) -> None:
        self.page.click(f"#{button}", timeout=BUTTON_MS)
