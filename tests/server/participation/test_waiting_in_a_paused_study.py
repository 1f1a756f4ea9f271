"""How long somebody waits for a partner if a researcher pauses the study: nobody new can come in this time."""

from datetime import UTC, datetime, timedelta

import pytest
from sqlalchemy import update

from server.participation import places, progress
from server.store import interventions, participants
from server.store.tables import study_pauses, visits
from tests.server.participation.test_partner_withdraws import MakePair, Pair, make
from tests.server.participation.test_places import NOON

__all__ = ["make"]


def opened_page(pair: Pair, seconds_ago: float) -> None:
    """The one who stays came to the first round that many seconds ago."""
    pair.walk_to(pair.stays, "episode-01")
    pair.database.write_now(progress.arrive, pair.studies, pair.stays)
    query = update(visits).where(visits.c.step_key == "episode-01")
    at = datetime.now(UTC) - timedelta(seconds=seconds_ago)
    pair.database.write_now(lambda connection: connection.execute(query.values(entered_at=at)))


async def waited_s(pair: Pair) -> float:
    found = await pair.seating.find(pair.tokens[0], "pairs")
    assert found is not None
    assert found.request is not None
    return found.request.waited_s


async def test_the_wait_goes_through_reloads_without_the_pauses_of_the_study(make: MakePair) -> None:
    pair = await make()
    opened_page(pair, seconds_ago=60)
    assert await waited_s(pair) == pytest.approx(60, abs=5)
    pair.database.write_now(interventions.pause_study, "pairs", "mara")
    query = update(study_pauses).values(paused_at=datetime.now(UTC) - timedelta(seconds=40))
    pair.database.write_now(lambda connection: connection.execute(query))
    assert await waited_s(pair) == pytest.approx(20, abs=5)
    opened_page(pair, seconds_ago=-1)
    assert await waited_s(pair) == 0, "the clock was set back"


async def test_nobody_can_come_while_the_study_is_paused(make: MakePair) -> None:
    pair = await make()
    opened_page(pair, seconds_ago=0)
    pair.database.write_now(interventions.pause_study, "pairs", "mara")
    assert await pair.seating.outlook(pair.stays) == "stopped"
    pair.database.write_now(interventions.resume_study, "pairs", "mara")
    assert await pair.seating.outlook(pair.stays) == "open"


async def test_somebody_whom_a_researcher_released_does_not_wait_any_longer(make: MakePair) -> None:
    pair = await make()
    opened_page(pair, seconds_ago=0)
    pair.database.write_now(participants.leave, pair.stays, "returned")
    assert await pair.seating.outlook(pair.stays) == "gone"


@pytest.mark.parametrize(
    ("pauses", "expected"),
    [([], 60), ([(40, 30)], 50), ([(40, None)], 20), ([(90, 50), (20, 10)], 40), ([(90, 70)], 60), ([(90, None)], 0)],
)
def test_the_seconds_of_pauses_are_left_out(pauses: list[tuple[int, int | None]], expected: int) -> None:
    def ago(seconds: int) -> datetime:
        return NOON - timedelta(seconds=seconds)

    given = [(ago(begun), None if ended is None else ago(ended)) for begun, ended in pauses]
    assert places.unpaused_s(ago(60), NOON, given) == expected
