"""Count the people without a first partner, in a study with rounds of two people."""

from datetime import datetime
from typing import Final

from sqlalchemy import Connection, exists, func, select

from server.store.events import PARTNER_WITHDREW
from server.store.tables import events, participants

PAIRED: Final = "paired"  # kind of the event of each participant of a round that begins with two people
ALONE: Final = "alone"  # kind of the event of a participant who continues without another person
_MET: Final = (PAIRED, ALONE, PARTNER_WITHDREW)


def unpaired(connection: Connection, study_id: int, since: datetime, simulated: bool = False) -> dict[str, int]:
    """Count, by condition, the active people (or bots) who have opened a page since this moment and have neither met a
    partner nor continued alone."""
    p = participants.c
    met = exists().where(events.c.participant_id == p.id, events.c.kind.in_(_MET)).correlate(participants)
    query = select(p.condition, func.count()).where(p.study_id == study_id, p.simulated == simulated)
    query = query.where(p.status == "active", p.last_seen_at >= since, ~met)
    return {row[0]: row[1] for row in connection.execute(query.group_by(p.condition))}
