"""Misled participants are told so, also those who leave before the debriefing page."""

from collections.abc import Iterator
from pathlib import Path

import pytest

from server.store.tables import participants as table
from tests.support.page_site import SMALL_STUDY, PageSite, Visitor

WORDS = "wrong on purpose"


def study(predictor: str) -> str:
    text = SMALL_STUDY.replace("name: small", f"name: {predictor}", 1)
    arms = text.partition("conditions:\n")[2].partition("\nagents:")[0]
    text = text.replace(arms, f"  - {{name: only, predictor: {predictor}}}")
    return text.replace("\npages:", "\ndebriefing: goodbye\npages:").replace("Thank **you**.", WORDS)


@pytest.fixture
def site(tmp_path: Path) -> Iterator[PageSite]:
    with PageSite(tmp_path, study("misleading"), study("tom")) as running:
        yield running


@pytest.mark.parametrize(("name", "told"), [("misleading", True), ("tom", False)])
def test_participants_whose_participation_ends_early_read_the_debriefing(site: PageSite, name: str, told: bool) -> None:
    visitor = Visitor(site)
    visitor.consent(name)
    ended = {"status": "timed_out"}
    site.database.write_now(lambda connection: connection.execute(table.update().values(ended)))
    assert (WORDS in visitor.get(f"/s/{name}/now").text) == told


@pytest.mark.parametrize(("name", "told"), [("misleading", True), ("tom", False)])
def test_withdrawing_participants_read_it_too_and_are_deleted(site: PageSite, name: str, told: bool) -> None:
    visitor = Visitor(site)
    visitor.consent(name)
    visitor.get(f"/s/{name}/withdraw")
    gone = visitor.send(f"/s/{name}/withdraw", visitor.fields("/withdraw"))
    assert (WORDS in gone.text) == told
    assert site.everybody(name) == []
