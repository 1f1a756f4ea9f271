"""Places in the conditions of a study: who holds one, and when it is free again. A study's places are those of all its
versions together, as a new version must not recruit everybody once more."""

from collections.abc import Iterable, Sequence
from datetime import UTC, datetime, timedelta

from sqlalchemy import Connection

from server.participation.served_studies import Studies
from server.store import interventions, overview, participants, studies
from server.store.overview import Group
from server.store.participants import Participant
from server.study.assignment import Count
from server.study.definition import Study

Pause = tuple[datetime, datetime | None]  # from, until; None: it lasts


def held(connection: Connection, study_ids: Sequence[int], study: Study, simulated: bool = False) -> dict[str, Count]:
    """Return how many people (or bots) of these versions hold a place in each condition. Bots never take a person's
    place. A participant who consented and then did nothing holds one for `hold_min` only; one who completed the study
    and is excluded holds none if the study says `replace_excluded`."""
    found = participants.counts(connection, study_ids, simulated)
    silent = participants.silent(connection, study_ids, unseen_before(connection, study, study.hold_min), simulated)
    free = overview.excluded(connection, Group(study_ids, simulated)) if study.replace_excluded else {}
    return {
        name: Count(by.get("completed", 0) - free.get(name, 0), by.get("active", 0) - silent.get(name, 0))
        for name, by in found.items()
    }


def release(connection: Connection, all_studies: Studies, study: Study) -> int:
    """Release the places of participants, of any version, who were not seen for too long; return how many."""
    released = 0
    for study_id in studies.ids_of(connection, study.name):
        theirs = all_studies.version(study_id) or study  # a version that can no longer be read
        before = unseen_before(connection, study, theirs.timeout_min)
        released += participants.time_out(connection, study_id, before)
    return released


def is_lost(connection: Connection, all_studies: Studies, participant: Participant) -> bool:
    """Return whether the participant was inactive for so long after consent that others have taken all places; if so,
    end the participation."""
    study, name = all_studies.of(participant), participant.condition
    quota = _quota(all_studies, study, name)
    if quota is None or participant.position > 0:
        return False
    if participant.started_at >= unseen_before(connection, study, study.hold_min):
        return False
    ids = studies.ids_of(connection, study.name)
    if held(connection, ids, study, participant.simulated)[name].held < quota:
        return False
    if not participants.is_silent(connection, participant.id):
        return False
    return participants.leave(connection, participant.id, "timed_out")


def _quota(all_studies: Studies, study: Study, condition: str) -> int | None:
    """Return the quota of the version that takes new participants; of the participant's own where that has no such
    condition."""
    opened = all_studies.open(study.name)
    newest = study if opened is None else opened[1]
    known = newest if any(one.name == condition for one in newest.conditions) else study
    return known.condition(condition).quota


def unseen_before(connection: Connection, study: Study, minutes: float) -> datetime:
    """Return the moment since which so many minutes have passed in which the study was not paused: nobody is absent
    because a researcher made them wait."""
    return unpaused_ago(datetime.now(UTC), timedelta(minutes=minutes), interventions.pauses_of(connection, study.name))


def unpaused_s(since: datetime, until: datetime, pauses: Iterable[Pause]) -> float:
    """Return how many seconds of this time are left if the pauses are left out; 0 if the clock was set back since."""
    left = until - since
    for begun, ended in pauses:
        left -= max(min(ended or until, until) - max(begun, since), timedelta())
    return max(0.0, left.total_seconds())


def unpaused_ago(now: datetime, span: timedelta, pauses: Iterable[Pause]) -> datetime:
    """Return the moment from which `span` passes until `now` if the pauses are left out. Pauses do not overlap."""
    cursor = now
    for begun, ended in sorted(pauses, key=lambda pause: pause[0], reverse=True):
        running = max(cursor - (ended or now), timedelta())
        if running >= span:
            break
        span -= running
        cursor = min(cursor, begun)
    return cursor - span
