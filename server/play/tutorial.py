"""The lessons of a tutorial and when each is learnt: derived from the game's states, so that it also works after a
restart.
"""

from overcooked.constants import (
    COOKING,
    INTERACT,
    ONION_PICKUP,
    READY,
    SOUP_DELIVERY,
    SOUP_FROM_POT,
    STAY,
)
from server.play.simulation import SimulatedStep, Simulation

# key -> when it is learnt. Texts belong to the study and the templates.
LESSONS: dict[str, str] = {
    "walk": "the participant has walked to another cell",
    "fetch": "the participant has taken an onion",
    "fill": "a pot holds three onions",
    "wait": "a soup is ready",
    "plate": "the participant has lifted a soup with a dish",
    "deliver": "the participant has delivered a soup",
    "marks": "the participant has watched the marks for some timesteps and then pressed use",
}
MARKS_WATCHED_TIMESTEPS = 15
_COOKED = ("fetch", "fill", "wait", "plate")  # a delivery completes all of these


class Tutor:
    """Follows one participant through the lessons of a tutorial."""

    def __init__(self, lessons: tuple[str, ...], seat: int) -> None:
        unknown = [key for key in lessons if key not in LESSONS]
        if unknown:
            raise ValueError(f"unknown lessons {unknown}. Known: {', '.join(LESSONS)}.")
        self.lessons = lessons
        self._seat = seat
        self._learnt: set[str] = set()
        self._marks_watched = 0

    @property
    def index(self) -> int:
        """The lesson being taught, 0-based; `len(lessons)` when all are learnt."""
        return next((index for index, key in enumerate(self.lessons) if key not in self._learnt), len(self.lessons))

    @property
    def finished(self) -> bool:
        return self.index == len(self.lessons)

    def watch(self, simulation: Simulation, step: SimulatedStep) -> None:
        """Take one timestep into account: `step` led to the state in which `simulation` is now."""
        teaching = self.lessons[self.index] if not self.finished else None
        action, events = step.actions[self._seat], step.events[self._seat]
        if action < STAY and simulation.moved(self._seat):
            self._learnt.add("walk")
        if events & ONION_PICKUP:
            self._learnt.add("fetch")
        inside = simulation.pot_contents()
        if any(content >= COOKING for content in inside):
            self._learnt.add("fill")
        if any(content == READY for content in inside):
            self._learnt.add("wait")
        if events & SOUP_FROM_POT:
            self._learnt.add("plate")
        if events & SOUP_DELIVERY:
            self._learnt.update(("deliver", *_COOKED))
        if teaching == "marks":
            self._watch_marks(action)

    def _watch_marks(self, action: int) -> None:
        self._marks_watched += 1
        if self._marks_watched > MARKS_WATCHED_TIMESTEPS and action == INTERACT:
            self._learnt.add("marks")
