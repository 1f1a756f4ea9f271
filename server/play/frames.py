"""Decide what the frame of a state shows to each person: once per state; then it is stored and sent."""

from collections.abc import Mapping

from overcooked.constants import STAY
from server.play import intentions, marks, messages
from server.play.episode_spec import EpisodeSpec
from server.play.keys import Keys
from server.play.limited_sight import Sight
from server.play.marks_key import MarksKey
from server.play.misleading import wrong_future
from server.play.model_questions import Answers
from server.play.recorder import EpisodeRecord
from server.play.simulation import Simulation


class Frames:
    """The frames of one episode, from its record on. `watch` has to see every state."""

    def __init__(self, record: EpisodeRecord, simulation: Simulation) -> None:
        self._spec, self._simulation = record.spec, simulation
        self._viewer = viewer(record.spec)
        self.displayed = record.displayed or marks.display(record.spec, simulation.timestep, ())
        self.intention = record.displayed_intention or intentions.display(record.spec, simulation.layout, 0, ())
        self.asked = record.asked  # whether the participant asked for the marks on the current state; None: always
        self.in_sight: bool | None = None  # whether the watched chef is in the view of who sees marks; None: no limit
        self.misleading: bool | None = None  # whether the marks are a wrong future; None: they never are here
        # Timesteps, since this process plays it, whose display is not what the condition requires; and those of them in
        # which the models were late: the server is too slow for its games.
        self.violations = self.late_violations = 0
        radius, seats = record.spec.view_radius, record.spec.human_seats if record.spec.view_radius else ()
        self._sights = {seat: Sight(simulation.layout, seat, radius) for seat in seats}
        self.watch()

    def watch(self) -> None:
        """Update the limited sight of every participant with the current state."""
        if self._sights:
            kitchen = self._simulation.kitchen()
            for sight in self._sights.values():
                sight.look(kitchen)

    def ask(self, keys: Mapping[int, Keys]) -> None:
        """Note whether the marks are asked for on the state that is made now."""
        person = keys.get(self._viewer)
        if person is not None and person.marks_key is not None:
            self.asked = person.marks_key.take()

    def decide(self, answers: Answers, over: bool, models_late: bool = False) -> None:
        """Decide what the frame of the current state shows. If the episode is `over`, nothing is drawn. `models_late`:
        nobody waited for their answers any longer."""
        self.misleading = None
        sight = self._sights.get(self._viewer)
        self.in_sight = None if sight is None else sight.sees_partner(self._simulation.kitchen())
        if over:
            self._hide()
            return
        spec, timestep = self._spec, self._simulation.timestep
        self.displayed = marks.display(spec, timestep, answers.prediction)
        layout = self._simulation.layout
        self.intention = intentions.display(spec, layout, timestep, answers.intentions, spec.misleading)
        if spec.misleading:
            self._mislead(answers)
        due = self.asked is not False and self.in_sight is not False
        if not due:
            self._hide()
        elif sight is not None:
            self.displayed = sight.cut(self.displayed, self._simulation.kitchen())
        is_kept = marks.is_as_required(spec.shows_actions and due, self.displayed)
        is_kept = is_kept and intentions.is_as_required(spec.shows_intention and due, self.intention)
        self.violations += not is_kept
        self.late_violations += not is_kept and models_late

    def _hide(self) -> None:
        self.displayed, self.intention = marks.hidden(self.displayed), intentions.hidden(self.intention)

    def _mislead(self, answers: Answers) -> None:
        """Put the most plausible wrong future in the place of the predicted one."""
        rows = answers.prediction[: self._spec.steps_shown] if self._spec.shows_actions else ()
        decided = answers.next_actions[self._spec.watched_seat]  # what the watched chef does next, if an agent has it
        actions = wrong_future(self._simulation, self._spec.watched_seat, rows, decided) if rows else ()
        is_wrong = self._spec.shows_intention and intentions.wrong_intention(answers.intentions) is not None
        self.misleading = bool(actions) or is_wrong
        if actions:
            self.displayed = tuple(zip(actions, (opacity for _, opacity in self.displayed), strict=True))

    def welcome(self, person: int, episode: str, resumed: bool) -> messages.Welcome:
        """Return everything that one person's page needs to draw the game."""
        spec, simulation = self._spec, self._simulation
        state, partner_seen, unknown = self.seen_by(person)
        sees_predictions = spec.shown != "nothing" and person != spec.watched_seat
        return messages.Welcome(
            protocol=messages.PROTOCOL,
            episode=episode,
            kind=spec.kind,
            number=spec.number,
            episodes=spec.episodes,
            layout=spec.layout,
            title=spec.title,
            grid=simulation.layout.grid,
            seat=person,
            watched_seat=spec.watched_seat,
            horizon=spec.horizon,
            tick_ms=spec.tick_ms,
            steps=spec.steps_shown,
            shows_predictions=sees_predictions,
            state=state,
            resumed=resumed,
            endless=spec.horizon == 0,
            partner="human" if len(spec.human_seats) > 1 else "agent",
            show="always" if person == spec.watched_seat else spec.show,
            view_radius=spec.view_radius if person in spec.human_seats else 0,
            partner_seen=partner_seen,
            unknown=unknown,
            asked=self._asked_by(person),
            display=spec.display if sees_predictions else "none",
        )

    def tick(self, person: int, applied: int, late: bool) -> messages.Tick:
        """Return the frame of the current state for one person. Nobody sees predictions about themselves."""
        watched = person == self._spec.watched_seat
        displayed = marks.hidden(self.displayed) if watched else self.displayed
        intention = intentions.hidden(self.intention) if watched else self.intention
        actions = list(self._simulation.last_actions or (STAY, STAY))
        state, partner_seen, unknown = self.seen_by(person)
        if not partner_seen:
            actions[1 - person] = STAY
        return messages.Tick(
            state=state,
            prediction=displayed,
            actions=(actions[0], actions[1]),
            applied=applied,
            late=late,
            partner_seen=partner_seen,
            unknown=unknown,
            asked=self._asked_by(person),
            intention=intention,
            pad=intentions.padding(intention),
        )

    def _asked_by(self, person: int) -> bool:
        return not _on_demand(self._spec, person) or bool(self.asked)

    def seen_by(self, person: int) -> tuple[messages.KitchenState, bool, tuple[tuple[int, int], ...]]:
        """Return the current state as one person knows it, whether the partner is in view, and cells that were never
        seen."""
        kitchen, sight = self._simulation.kitchen(), self._sights.get(person)
        if sight is None:
            return kitchen, True, ()
        return sight.masked(kitchen), sight.sees_partner(kitchen), sight.unknown


def viewer(spec: EpisodeSpec) -> int:
    """Return the seat of the person who sees the marks, if a person has it."""
    return 1 - spec.watched_seat


def marks_key(record: EpisodeRecord, seat: int) -> MarksKey | None:
    """Return the marks key of the person in this seat; None where the marks need none."""
    spec = record.spec
    if spec.show == "always" or not _on_demand(spec, seat):
        return None
    return MarksKey(spec.show, bool(record.asked))


def _on_demand(spec: EpisodeSpec, seat: int) -> bool:
    return spec.show != "always" and spec.shown != "nothing" and seat == viewer(spec)
