"""Rounds of two people, as functions on one database transaction: waiting, seating, and continuing alone. Two people
who have played together stay together; a participant who has lost the partner, or never met one, continues with the
study's fallback agent.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime

from sqlalchemy import Connection, func, select

from server.participation import next_step, places
from server.participation.served_studies import Studies
from server.participation.waiting_room import Outlook, PairingRequest
from server.store import episodes, events, interventions, participants, withdrawal
from server.store.episodes import StoredEpisode
from server.store.participants import Participant
from server.store.tables import visits
from server.store.unpaired import ALONE, PAIRED
from server.study.definition import Study
from server.study.steps import StudyStep

SeatDown = Callable[[Connection, Sequence[Participant], StudyStep], str]  # makes the episode of one or two people


@dataclass(frozen=True)
class Company:
    """A participant's rounds of two so far."""

    partner: str | None = None  # whom they have played with
    alone: str = ""  # why they play without anybody; empty: they do not


def is_for_two(study: Study, step: StudyStep) -> bool:
    """Return whether this step is a round of two people."""
    return step.kind == "episode" and study.agent(step.agent).human


def company(connection: Connection, studies: Studies, participant: Participant, step: StudyStep) -> Company:
    """Return the participant's partner, or why there is none."""
    study = studies.of(participant)
    rounds = {one.key for one in studies.steps_of(participant) if is_for_two(study, one) and one.number < step.number}
    if rounds & withdrawal.deleted_rounds(connection, participant.id):
        return Company(alone="partner_left")
    played = [one for one in episodes.of_participant(connection, participant.id) if one.step_key in rounds]
    if not played:
        return Company()
    last = max(played, key=lambda one: (one.number, one.attempt))
    other = _other(last, participant.id)
    if other is None:
        had_a_partner = any(_other(one, participant.id) for one in played)
        return Company(alone="partner_left" if had_a_partner else "nobody_came")
    if last.end_reason in ("away", "error", "withdrawn"):
        return Company(alone="partner_left")
    partner = participants.get(connection, other)
    theirs = episodes.of_step(connection, other, step.key)
    is_there = partner is not None and partner.status == "active" and theirs is None
    return Company(other) if is_there else Company(alone="partner_left")


def expects_partner(connection: Connection, studies: Studies, participant: Participant, step: StudyStep) -> bool:
    """Return whether the participant may still expect a person in this round: it is for two people, and no round
    before it was continued with an agent."""
    if not is_for_two(studies.of(participant), step):
        return False
    alone = events.of_participant(connection, participant.id, ALONE)
    return all(one.detail.get("step") == step.key for one in alone)


def has_begun(connection: Connection, participant_id: str, step: StudyStep) -> bool:
    """Return whether the participant has a seat in this round, or had one until the partner withdrew."""
    is_seated = episodes.of_step(connection, participant_id, step.key) is not None
    return is_seated or is_deleted(connection, participant_id, step)


def is_deleted(connection: Connection, participant_id: str, step: StudyStep) -> bool:
    """Return whether the partner's withdrawal deleted this round; it is over then."""
    return step.key in withdrawal.deleted_rounds(connection, participant_id)


def request(
    connection: Connection, studies: Studies, participant: Participant, step: StudyStep, partner: str | None
) -> PairingRequest:
    """Return the participant's pairing request. The wait counts from the time when they first opened the page of the
    round, without the pauses of the study, in which nobody new can come."""
    first = select(func.min(visits.c.entered_at))
    since = connection.execute(
        first.where(visits.c.participant_id == participant.id, visits.c.step_key == step.key)
    ).scalar()
    room = (participant.study_id, participant.condition, step.key, participant.simulated)
    study, now = studies.of(participant), datetime.now(UTC)
    waited_s = places.unpaused_s(since or now, now, interventions.pauses_of(connection, study.name))
    return PairingRequest(room, since or now, study.waiting_room.limit_s, partner, waited_s)


def outlook(connection: Connection, studies: Studies, participant_id: str) -> Outlook:
    """Return whether somebody can still come to the coming round of a participant who waits. Nobody comes to somebody
    whose participation is over: a researcher has released the place."""
    participant = participants.get(connection, participant_id)
    if participant is None or participant.status != "active":
        return "gone"
    if company(connection, studies, participant, studies.step(participant)).alone:
        return "gone"
    is_paused = studies.of(participant).name in interventions.paused_studies(connection)
    return "stopped" if is_paused else "open"


def seat_two(connection: Connection, studies: Studies, seat_down: SeatDown, first: str, second: str) -> bool:
    """Create the round of these two. Returns False, and changes nothing, if one of them can no longer play it."""
    both = [participants.get(connection, one) for one in (first, second)]
    present = [one for one in both if one is not None and one.status == "active"]
    if len(present) < len(both):
        return False
    here = [studies.step(one) for one in present]
    if here[0].key != here[1].key or any(has_begun(connection, one.id, here[0]) for one in present):
        return False
    episode = seat_down(connection, _as_before(connection, studies.of(present[0]), present), here[0])
    for one in present:
        _note(connection, one.id, PAIRED, here[0], episode=episode)
    return True


def _as_before(connection: Connection, study: Study, pair: list[Participant]) -> list[Participant]:
    """Return the seats: two who have played together keep theirs, so the same person stays watched. Otherwise the first
    gets the study's seat."""
    first, second = pair
    both = {first.id, second.id}
    together = [
        (one.participant_0, one.participant_1)
        for one in episodes.of_participant(connection, first.id)
        if {one.participant_0, one.participant_1} == both
    ]
    return pair if not together or together[-1][study.game.human_seat] == first.id else [second, first]


def go_alone(connection: Connection, studies: Studies, seat_down: SeatDown, participant_id: str) -> None:
    """Let the participant continue alone: with the fallback agent, or to the end of the study with a code, as its file
    says."""
    participant = participants.get(connection, participant_id)
    if participant is None or participant.status != "active":
        return
    step, study = studies.step(participant), studies.of(participant)
    if not is_for_two(study, step) or has_begun(connection, participant_id, step):
        return
    mates = company(connection, studies, participant, step)
    why = mates.alone or ("partner_left" if mates.partner else "nobody_came")
    if study.waiting_room.fallback == "leave":
        participants.release_with_code(connection, participant_id, next_step.new_code())
        _note(connection, participant_id, ALONE, step, why=why)
    else:
        episode = seat_down(connection, [participant], step)
        _note(connection, participant_id, ALONE, step, why=why, episode=episode)


def leave_without_partner(connection: Connection, studies: Studies, participant: Participant) -> bool:
    """End the participation, with a code, of somebody at the page before a round whose partner has left, if the study
    has no agent in their place. Return whether it did: the page would announce a round that does not come."""
    study, steps = studies.of(participant), studies.steps_of(participant)
    coming = steps[participant.position + 1] if participant.position + 1 < len(steps) else None
    is_before = studies.step(participant).kind == "ready" and study.waiting_room.fallback == "leave"
    if coming is None or not is_before or not is_for_two(study, coming):
        return False
    why = company(connection, studies, participant, coming).alone
    if not why or not participants.release_with_code(connection, participant.id, next_step.new_code()):
        return False
    _note(connection, participant.id, ALONE, coming, why=why)
    return True


def _note(
    connection: Connection, participant: str, kind: str, step: StudyStep, why: str = "", episode: str = ""
) -> None:
    detail = {"step": step.key} | ({"why": why} if why else {})
    events.add(connection, events.Event(kind, datetime.now(UTC), participant, episode or None, detail))


def _other(episode: StoredEpisode, participant: str) -> str | None:
    """Return the other person of an episode; None where that seat is an agent's."""
    seats = (episode.participant_0, episode.participant_1)
    return seats[1 - seats.index(participant)]
