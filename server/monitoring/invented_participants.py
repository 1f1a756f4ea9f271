"""Detect signs that somebody fills a study with invented participants, as texts for alerts without addresses or
persons.
"""

from collections.abc import Sequence
from datetime import UTC, datetime, timedelta
from typing import Final

from server.monitoring.interfaces import MonitoredServer
from server.store import enrolment_limits, participants

WINDOW: Final = timedelta(hours=1)
FEWEST: Final = 5  # inactive people; fewer are not a sign
SHARE: Final = 0.5  # of those who consented in the window


async def signs(web: MonitoredServer, study: str, versions: Sequence[int], leads: bool) -> dict[str, str]:
    """Return the texts of alerts by their keys. `leads`: this process reports what all of them see in the database.
    Raises DatabaseDown.
    """
    found: dict[str, str] = {}
    if not leads:
        return found
    turned_away = await web.database.read(enrolment_limits.turned_away, study, datetime.now(UTC))
    if turned_away:
        limit = web.enrolment_limits.an_hour
        found[f"places {study}"] = (
            f"{study}: one address asked for more than {limit} new places in an hour; {turned_away} were refused. "
            "For a lab or a class behind one address, raise KITCHENMIND_NEW_PER_ADDRESS. If they do not sit together, "
            "check that the server believes your proxy about addresses (KITCHENMIND_TRUSTED_PROXIES)."
        )
    opened = web.studies.open(study)
    if opened is not None:
        hold = timedelta(minutes=opened[1].hold_min)
        now = datetime.now(UTC)
        span = (now - hold - WINDOW, now - hold)
        new, silent = await web.database.read(participants.consented_since, versions, *span)
        if silent >= FEWEST and silent >= SHARE * new:
            found[f"silent {study}"] = (
                f"{study}: {silent} of {new} people who consented within an hour have done nothing since. "
                "Somebody may be filling the study. Their places are free again."
            )
    return found
