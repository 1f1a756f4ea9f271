"""Find the game and the seat of a participant: the episode of their current step in the database."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from datetime import UTC, datetime, timedelta
from typing import Final

from sqlalchemy import Connection

from server.participation import pairing
from server.participation.episode_specs import agent_of, episode_spec
from server.participation.served_studies import Studies
from server.participation.waiting_room import Outlook, PairingRequest
from server.play.episode_spec import EpisodeSpec
from server.play.session import VIEWER
from server.store import episodes, participants
from server.store.database import Database
from server.store.episodes import NewEpisode, StoredEpisode
from server.store.participants import Participant
from server.study.steps import StudyStep, step_address

SEEN_EVERY: Final = timedelta(minutes=1)  # somebody who waits
Fingerprint = Callable[[str, str], str | None]  # (layout, model) -> sha256 of its checkpoint


@dataclass(frozen=True)
class ConnectedPlayer:
    """The participant of a socket, and their game."""

    participant: str
    episode: str | None  # None: their current step is not a game
    seat: int  # server.play.session.VIEWER for somebody who watches two agents
    next_url: str
    request: PairingRequest | None = None  # they wait for another person


@dataclass(frozen=True)
class Seating:
    """Finds a participant's game. `fingerprint` and `code_version` go into the record of a new episode."""

    database: Database
    studies: Studies
    fingerprint: Fingerprint
    code_version: str

    async def find(self, token: str | None, study: str) -> ConnectedPlayer | None:
        """Return the participant with this token of the study and their game; None if there is none. Raises
        DatabaseDown."""
        if not token:
            return None
        participant, player = await self.database.read(self._find_seat, token, study)
        if participant is None or player is not None:
            return player
        return await self.database.write(self._seat, participant)

    def _find_seat(self, connection: Connection, token: str, study: str) -> tuple[str | None, ConnectedPlayer | None]:
        """Return the participant with this token and their existing seat, without a write: a reconnection need not wait
        for a commit."""
        participant = participants.by_token(connection, token)
        if participant is not None and self.studies.version(participant.study_id) is None:
            self.studies.learn(connection)  # another process serves a newer version
        version = self.studies.version(participant.study_id) if participant else None
        if participant is None or version is None or version.name != study:
            return None, None
        return participant.id, self._seated(connection, participant, self.studies.step(participant))

    def _seat(self, connection: Connection, participant_id: str) -> ConnectedPlayer | None:
        """Return the participant's seat, creating it if necessary."""
        participant = participants.get(connection, participant_id)
        if participant is None:
            return None
        step = self.studies.step(participant)
        player = self._seated(connection, participant, step)
        if player is not None:
            return player
        if not pairing.is_for_two(self.studies.of(participant), step):
            self._sit(connection, [participant], step)
        else:
            mates = pairing.company(connection, self.studies, participant, step)
            if not mates.alone:
                request = pairing.request(connection, self.studies, participant, step, mates.partner)
                return ConnectedPlayer(participant_id, None, VIEWER, self._next_url(participant), request)
            pairing.go_alone(connection, self.studies, self._sit, participant_id)
        return self._seated(connection, participant, step)

    def _seated(self, connection: Connection, participant: Participant, step: StudyStep) -> ConnectedPlayer | None:
        """Return their game at this step; None if they have no seat yet."""
        nothing = ConnectedPlayer(participant.id, None, VIEWER, self._next_url(participant))
        if participant.status != "active" or not step.is_game:
            return nothing
        episode = episodes.of_step(connection, participant.id, step.key)
        if episode is None and pairing.is_deleted(connection, participant.id, step):
            return nothing
        if episode is None or _to_be_repeated(step, episode):
            return None
        if episode.status in ("done", "aborted"):
            return nothing
        return replace(nothing, episode=episode.id, seat=_seat_of(participant, episode))

    def _next_url(self, participant: Participant) -> str:
        return step_address(self.studies.of(participant).name)

    async def seat_two(self, first: str, second: str) -> bool:
        """Create the round of these two people; return False if one of them can no longer play it."""
        return await self.database.write(pairing.seat_two, self.studies, self._sit, first, second)

    async def seat_alone(self, participant_id: str) -> None:
        """Seat a person for whom no partner arrived."""
        await self.database.write(pairing.go_alone, self.studies, self._sit, participant_id)

    async def outlook(self, participant_id: str) -> Outlook:
        """Return whether somebody can still come to the coming round of a person who waits, and note that they are
        there: their page is not loaded again, and others must not take them for gone."""
        found, was_noted = await self.database.read(self._outlook, participant_id)
        if found != "gone" and not was_noted:
            await self.database.write(participants.seen, participant_id)
        return found

    def _outlook(self, connection: Connection, participant_id: str) -> tuple[Outlook, bool]:
        participant = participants.get(connection, participant_id)
        lately = datetime.now(UTC) - SEEN_EVERY
        was_noted = participant is not None and participant.last_seen_at > lately
        return pairing.outlook(connection, self.studies, participant_id), was_noted

    def _sit(self, connection: Connection, people: Sequence[Participant], step: StudyStep) -> str:
        return episodes.create(connection, self._new(people, step))

    def _new(self, people: Sequence[Participant], step: StudyStep) -> NewEpisode:
        participant, study = people[0], self.studies.of(people[0])
        spec = episode_spec(study, step, participant.condition, participant.language, len(people))
        ids = iter([one.id for one in (people if study.game.human_seat == 0 else reversed(people))])
        return NewEpisode(
            spec=spec,
            step_key=step.key,
            participants=tuple(next(ids) if agent is None else None for agent in spec.agents),  # type: ignore[arg-type]
            study_id=participant.study_id,
            condition=participant.condition,
            agent_sha256s=(self._agent(spec, 0), self._agent(spec, 1)),
            predictor_sha256=self.fingerprint(spec.layout, spec.predictor) if spec.predictor else None,
            code_version=self.code_version,
            agent_name=agent_of(study, step, len(people)).name,
        )

    def _agent(self, spec: EpisodeSpec, seat: int) -> str | None:
        agent = spec.agents[seat]
        return None if agent is None else self.fingerprint(spec.layout, agent)


def _seat_of(participant: Participant, episode: StoredEpisode) -> int:
    return (episode.participant_0, episode.participant_1).index(participant.id)


def _to_be_repeated(step: StudyStep, episode: StoredEpisode) -> bool:
    """Return whether the tutorial starts again, because it ended without being passed."""
    return step.kind == "tutorial" and episode.status in ("done", "aborted") and not episode.passed
