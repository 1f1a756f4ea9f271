"""Somebody took part in a version that this server does not have: another process opened it a moment ago, or it cannot
be read since an upgrade."""

from collections.abc import Iterator
from pathlib import Path

import pytest

from server.store import participants
from tests.server.web.participant.test_changed_consent import open_version
from tests.server.web.participant.test_recruiters import RECRUITMENTS
from tests.support.page_site import SMALL_STUDY, PageSite, Visitor

HIRED = SMALL_STUDY.replace("seed: 11\n", f"seed: 11\nrecruitment: {RECRUITMENTS['prolific']}\n", 1)
LINK = f"?PROLIFIC_PID={1:024x}&STUDY_ID=s1&SESSION_ID=x9"
CODE = "KM-ABCD-EFGH"


@pytest.fixture
def site(tmp_path: Path) -> Iterator[PageSite]:
    with PageSite(tmp_path, HIRED) as running:
        yield running


def take_part(site: PageSite, ended: bool) -> int:
    """Return the version of somebody whose version is not known afterwards."""
    assert Visitor(site).consent("small", LINK).status_code == 200
    person = site.only("small")
    if ended:
        site.database.write_now(participants.complete, person.id, CODE)
    open_version(site, HIRED.replace("horizon: 20", "horizon: 30", 1))
    del site.studies._versions[person.study_id]
    return person.study_id


def people(site: PageSite, version: int) -> int:
    return len(site.database.read_now(participants.of_study, version)) + len(site.everybody("small"))


@pytest.mark.parametrize("ended", [True, False])
def test_nobody_takes_part_once_more(site: PageSite, ended: bool) -> None:
    version = take_part(site, ended)
    visitor = Visitor(site)
    visitor.get(f"/s/small{LINK}")
    if ended:
        assert "/consent" not in visitor.page.text
    else:
        assert (
            visitor.send("/s/small/consent", visitor.fields("/consent") | {"box_0": "yes"}).url.path == "/s/small/now"
        )
    assert people(site, version) == 1


def test_somebody_whose_version_cannot_be_read_any_more_may_begin_again(site: PageSite) -> None:
    version = take_part(site, ended=False)
    site.studies._unreadable.add(version)
    assert Visitor(site).consent("small", LINK).url.path == "/s/small/now"
    assert people(site, version) == 2


def test_the_code_deletes_the_data(site: PageSite) -> None:
    version = take_part(site, ended=True)
    site.studies._unreadable.add(version)
    visitor = Visitor(site)
    visitor.get("/s/small/withdraw")
    assert visitor.send("/s/small/withdraw", visitor.fields("/withdraw") | {"code": CODE}).status_code == 200
    assert people(site, version) == 0
