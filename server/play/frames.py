"""What the frame of a state shows to each person: decided once a state, stored, then sent."""

from collections.abc import Mapping, Sequence

from server.play import marks
from server.play.episode_spec import EpisodeSpec
from server.play.keys import Keys
from server.play.marks_key import MarksKey
from server.play.recorder import EpisodeRecord


class Frames:
    """The displays of one episode, from its record on."""

    def __init__(self, record: EpisodeRecord, timestep: int) -> None:
        self._spec = record.spec
        self.displayed = record.displayed or marks.display(record.spec, timestep, ())
        self.asked = record.asked  # whether the participant asked for the marks on the current state; None: always
        self.violations = 0  # timesteps, since this process plays it, whose display breaks the promise

    def ask(self, keys: Mapping[int, Keys]) -> None:
        """Note whether the marks are asked for on the state that is made now."""
        person = keys.get(viewer(self._spec))
        if person is not None and person.marks_key is not None:
            self.asked = person.marks_key.take()

    def decide(self, timestep: int, prediction: Sequence[Sequence[float]], over: bool) -> None:
        """Decide what the frame of the current state shows. Nothing is done any more when the episode is `over`."""
        if over:
            self.displayed = marks.hidden(self.displayed)
            return
        self.displayed = marks.display(self._spec, timestep, prediction)
        due = self.asked is not False
        if not due:
            self.displayed = marks.hidden(self.displayed)
        self.violations += not marks.is_as_promised(self._spec.shown, self.displayed, due)

    def of(self, person: int) -> marks.Displayed:
        """What this person sees: nobody sees predictions about themselves."""
        return marks.hidden(self.displayed) if person == self._spec.watched_seat else self.displayed


def viewer(spec: EpisodeSpec) -> int:
    """The seat of the person who sees the marks, if a person has it."""
    return 1 - spec.watched_seat


def marks_key(record: EpisodeRecord, seat: int) -> MarksKey | None:
    """The marks key of the person in this seat; None where the marks need none."""
    spec = record.spec
    if spec.show == "always" or spec.shown == "nothing" or seat != viewer(spec):
        return None
    return MarksKey(spec.show, bool(record.asked))
