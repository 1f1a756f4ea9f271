"""Advance a participant to the step that the answers lead to, in one database transaction."""

import secrets
from collections.abc import Mapping
from datetime import UTC, datetime
from typing import Any

from sqlalchemy import Connection

from server.participation.page_answers import is_shown, not_asked
from server.participation.served_studies import Studies
from server.store import answers, events, participants
from server.store.participants import Participant
from server.study.steps import StudyStep

NOT_ASKED = "not_asked"  # kind of the event
_CODE_LETTERS = "23456789ABCDEFGHJKLMNPQRSTUVWXYZ"  # without characters that look alike


def new_code() -> str:
    """Return a completion code of 40 random bits, easy to read out."""
    letters = "".join(secrets.choice(_CODE_LETTERS) for _ in range(8))
    return f"KM-{letters[:4]}-{letters[4:]}"


def note(connection: Connection, participant_id: str, happened: Mapping[str, Mapping[str, Any]]) -> None:
    """Store the events of a page: a failed attention check, a wrong answer in the quiz."""
    now = datetime.now(UTC)
    new = [events.Event(kind, now, participant_id, detail=dict(detail)) for kind, detail in happened.items()]
    events.add(connection, *new)


def move_on(connection: Connection, all_studies: Studies, participant: Participant) -> bool:
    """Advance to the next step that the answers lead to; at the last one the participant has finished, and gets the
    code in the same transaction. Questions that are skipped because of answers are noted."""
    every, study = all_studies.steps_of(participant), all_studies.of(participant)
    earlier = answers.of_participant(connection, participant.id) if study.branches else {}
    following, passed_over = participant.position + 1, list[StudyStep]()
    while following < len(every) and not is_shown(study, participant, every[following], earlier):
        passed_over.append(every[following])
        following += 1
    if following >= len(every) or not participants.advance(connection, participant.id, participant.position, following):
        return False
    for step in (*passed_over, every[following]) if study.branches else ():
        if (questions := not_asked(study, participant, step, earlier)) or step in passed_over:
            note(connection, participant.id, {NOT_ASKED: {"step": step.key, "questions": questions}})
    if every[following].kind == "thanks":
        participants.complete(connection, participant.id, new_code())
    return True
