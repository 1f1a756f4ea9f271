"""A study gets a new version while researchers watch it: nobody disappears from the counts or from an open page."""

import asyncio
from types import SimpleNamespace
from typing import Any, cast

import pytest

from server.monitoring.arm_names import arm_names
from server.monitoring.enrolment_flow import arms_of, flow_of, stock
from server.participation import progress
from server.participation.progress import ConsentArrival
from server.participation.served_studies import Studies
from server.store import overview, participants
from server.store.database import Database
from server.store.participants import Participant
from server.study.loader import parse_study
from server.web.admin.live_boards import Watching
from tests.server.web.participant.test_filling_a_study import ONE_EACH

RENAMED = ONE_EACH.replace("name: with,", "name: marks,").replace("name: with}", "name: marks}")


@pytest.fixture
def studies(database: Database) -> Studies:
    return asyncio.run(Studies.opened(database, [parse_study(ONE_EACH)]))


def arrive(database: Database, studies: Studies) -> Participant:
    return database.write_now(progress.enrol, studies, ConsentArrival("small", participants.new_token()))


def open_renamed(database: Database, studies: Studies) -> None:
    studies.let_into("small", asyncio.run(studies.add(database, parse_study(RENAMED))))


@pytest.mark.parametrize("blind", [True, False])
def test_people_of_a_condition_that_the_new_version_has_not_are_still_counted(
    database: Database, studies: Studies, blind: bool
) -> None:
    for _ in range(2):
        arrive(database, studies)
    open_renamed(database, studies)
    arrive(database, studies)
    found = studies.open("small")
    assert found is not None
    held = database.read_now(stock, overview.Group(studies.versions("small")))
    arms = arms_of(found[1], held, arm_names(found[1], blind, held.conditions), blind)
    assert sum(arm["active"] for arm in arms) == 3 == flow_of(found[1], held)[0]["reached"]
    (former,) = [arm for arm in arms if arm["former"]]
    assert former is arms[-1]
    assert (former["active"], former["target"]) == (1, 1), "its place is taken, and nobody else comes to it"
    assert former["name"] == ("Earlier arm A" if blind else "with")
    assert sum(arm["target"] for arm in arms) == 3


@pytest.mark.parametrize("blind", [True, False])
def test_an_open_page_follows_to_a_new_version(database: Database, studies: Studies, blind: bool) -> None:
    web, admin = SimpleNamespace(studies=studies), SimpleNamespace(blind=blind)
    watching = Watching(cast(Any, web), cast(Any, None), "small", cast(Any, admin))
    before = watching.study_ids
    watching.follow()
    assert watching.study_ids == before
    open_renamed(database, studies)
    watching.follow()
    assert set(watching.study_ids) > set(before)
    assert [condition.name for condition in watching.study.conditions] == ["without", "marks"]
    assert watching.arms == ({} if blind else {name: name for name in ("without", "marks", "with")})
