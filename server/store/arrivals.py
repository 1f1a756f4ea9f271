"""Counts of browsers that opened a study's link, and of those turned away before consent, by reason. No data about
persons.
"""

from collections.abc import Sequence
from typing import Final

from sqlalchemy import Connection, func, select, update

from server.store.tables import arrivals

OPENED, DECLINED, UNSUITABLE, SUITABLE = KINDS = ("opened", "declined", "unsuitable", "suitable")
REASONS: Final = (
    "",
    "browser",
    "screen",
    "input",
    "latency",
    "websocket",
)  # of `unsuitable`; `suitable` takes one back


def count(connection: Connection, study_id: int, kind: str, reason: str = "") -> None:
    """Count a browser. `suitable`: a browser that failed for this reason passed after all."""
    a = arrivals.c
    here = (a.study_id == study_id, a.kind == kind, a.reason == reason)
    if not connection.execute(update(arrivals).where(*here).values(count=a.count + 1)).rowcount:
        connection.execute(arrivals.insert().values(study_id=study_id, kind=kind, reason=reason, count=1))


def of_study(connection: Connection, study_ids: Sequence[int]) -> dict[tuple[str, str], int]:
    """Return the counts by (kind, reason); those who passed at a later try are subtracted from `unsuitable`."""
    a = arrivals.c
    query = select(a.kind, a.reason, func.sum(a.count)).where(a.study_id.in_(study_ids)).group_by(a.kind, a.reason)
    found = {(row[0], row[1]): int(row[2]) for row in connection.execute(query)}
    for reason in REASONS:
        passed = found.pop((SUITABLE, reason), 0)
        if passed:
            found[UNSUITABLE, reason] = max(0, found.get((UNSUITABLE, reason), 0) - passed)
    return {key: number for key, number in found.items() if number}
