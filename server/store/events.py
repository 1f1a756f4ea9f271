"""Things that happened apart from the game: reloads, takeovers, errors on the browser's console, round trips."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from datetime import datetime
from typing import Any

from sqlalchemy import Connection, func, select

from server.store.tables import events, participants

ATTENTION_SCREENED_OUT = "attention_screened_out"  # kind of the event of a participant who failed too many checks
MORE_TIME = "more_time"  # kind of the event of an episode in which a researcher lets people be away longer
PARTNER_WITHDREW = "partner_withdrew"  # kind of the event of a participant whose round was deleted with the partner


@dataclass(frozen=True)
class Event:
    """`kind`: reload, takeover, trouble, rtt, ...; `detail`: JSON; no personal data, no tokens."""

    kind: str
    at: datetime
    participant_id: str | None = None
    episode_id: str | None = None
    detail: Mapping[str, Any] = field(default_factory=dict)


def add(connection: Connection, *new: Event) -> None:
    """Store events."""
    if new:
        rows = [
            {
                "kind": event.kind,
                "at": event.at,
                "participant_id": event.participant_id,
                "episode_id": event.episode_id,
                "detail": dict(event.detail),
            }
            for event in new
        ]
        connection.execute(events.insert(), rows)


def add_at_most(connection: Connection, new: Event, most: int) -> bool:
    """Store an event, unless the participant has `most` of its kind already, or was deleted while a page was open.
    Returns whether it was stored."""
    if connection.execute(select(participants.c.id).where(participants.c.id == new.participant_id)).first() is None:
        return False
    same = (events.c.participant_id == new.participant_id, events.c.kind == new.kind)
    if connection.execute(select(func.count()).select_from(events).where(*same)).scalar_one() >= most:
        return False
    add(connection, new)
    return True


def more_time_s(connection: Connection, *episode_ids: str) -> dict[str, float]:
    """Return how much longer than their study says people may be away in those of these episodes where a researcher
    has allowed it."""
    query = select(events.c.episode_id, events.c.detail)
    found: dict[str, float] = {}
    for episode, detail in connection.execute(
        query.where(events.c.episode_id.in_(episode_ids), events.c.kind == MORE_TIME)
    ):
        found[episode] = found.get(episode, 0.0) + float(detail["seconds"])
    return found


def of_participant(connection: Connection, participant_id: str, kind: str | None = None) -> list[Event]:
    """Return what happened to a participant, in order."""
    query = select(events).where(events.c.participant_id == participant_id).order_by(events.c.id)
    if kind is not None:
        query = query.where(events.c.kind == kind)
    return [
        Event(row.kind, row.at, row.participant_id, row.episode_id, row.detail) for row in connection.execute(query)
    ]
