"""The language links and the way out of the pages that answer a consent form: the address of the form is not a page."""

import re
from collections.abc import Iterator
from html import unescape
from pathlib import Path

import pytest

from server.participation import progress
from server.store import interventions
from server.store.database import DatabaseDown
from server.store.enrolment_limits import EnrolmentLimitReached
from tests.server.web.participant.test_changed_consent import NEW, OLD, open_version
from tests.server.web.participant.test_filling_a_study import ONE_EACH
from tests.server.web.participant.test_recruiters import RECRUITMENTS
from tests.support.page_site import PageSite, Visitor

HIRED = ONE_EACH.replace("seed: 11\n", f"seed: 11\nrecruitment: {RECRUITMENTS['prolific']}\n", 1)


@pytest.fixture
def site(tmp_path: Path) -> Iterator[PageSite]:
    with PageSite(tmp_path, HIRED) as running:
        yield running


def link(number: int) -> str:
    return f"?PROLIFIC_PID={number:024x}&STUDY_ID=s1&SESSION_ID=x9"


def address(visitor: Visitor, pattern: str) -> str:
    (found,) = re.findall(rf'href="([^"]*{pattern}[^"]*)"', visitor.page.text)
    return str(visitor.page.url.join(unescape(found)))


def in_chinese(visitor: Visitor) -> None:
    assert visitor.get(address(visitor, "lang=zh")).status_code == 200
    assert '<html lang="zh"' in visitor.page.text


def test_a_full_study_can_be_read_in_another_language(site: PageSite) -> None:
    for number in (1, 2):
        Visitor(site).consent("small", link(number))
    late = Visitor(site)
    assert late.consent("small", link(3)).status_code == 409
    in_chinese(late)
    assert f"{3:024x}" in late.page.text, "the recruiter's parameters are kept"


def test_a_consent_page_that_is_shown_again_leads_out_with_the_recruiters_parameters(site: PageSite) -> None:
    visitor = Visitor(site)
    visitor.get(f"/s/small{link(1)}")
    open_version(site, HIRED.replace(OLD, NEW, 1))
    assert visitor.send("/s/small/consent", visitor.fields("/consent") | {"box_0": "yes"}).status_code == 409
    assert f"PROLIFIC_PID={1:024x}" in address(visitor, "/declined")
    in_chinese(visitor)
    assert visitor.fields("/consent")["PROLIFIC_PID"] == f"{1:024x}"


def test_a_study_that_is_paused_in_the_moment_of_consent_is_tried_again_with_the_recruiters_link(
    site: PageSite,
) -> None:
    visitor = Visitor(site)
    visitor.get(f"/s/small{link(1)}")
    site.database.write_now(interventions.pause_study, "small", "mara")
    assert visitor.send("/s/small/consent", visitor.fields("/consent") | {"box_0": "yes"}).status_code == 503
    (again,) = re.findall(r'class="btn" href="([^"]*)"', visitor.page.text)
    site.database.write_now(interventions.resume_study, "small", "mara")
    assert visitor.get(unescape(again)).status_code == 200
    assert visitor.fields("/consent")["PROLIFIC_PID"] == f"{1:024x}"


def test_an_error_of_the_database_at_consent_leads_back_with_the_recruiters_link(
    site: PageSite, monkeypatch: pytest.MonkeyPatch
) -> None:
    async def down(*_: object) -> None:
        raise DatabaseDown("away")

    visitor = Visitor(site)
    visitor.get(f"/s/small{link(1)}")
    monkeypatch.setattr(site.database, "write", down)
    assert visitor.send("/s/small/consent", visitor.fields("/consent") | {"box_0": "yes"}).status_code == 503
    (back,) = re.findall(r'class="btn" href="([^"]*)"', visitor.page.text)
    monkeypatch.undo()
    assert visitor.get(unescape(back)).status_code == 200
    assert visitor.fields("/consent")["PROLIFIC_PID"] == f"{1:024x}"


def test_an_error_of_the_database_at_the_link_is_tried_again_with_the_recruiters_parameters(
    site: PageSite, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Through the start page, the next best button, somebody would take part without an id."""

    async def down(*_: object) -> None:
        raise DatabaseDown("away")

    visitor = Visitor(site)
    monkeypatch.setattr(site.database, "read", down)
    assert visitor.get(f"/s/small{link(1)}").status_code == 503
    in_chinese_503 = visitor.get(address(visitor, "lang=zh"))
    assert "重试" in in_chinese_503.text
    (again,) = re.findall(r'class="btn" href="([^"]*)"', visitor.page.text)
    monkeypatch.undo()
    assert visitor.get(unescape(again)).status_code == 200
    assert visitor.fields("/consent")["PROLIFIC_PID"] == f"{1:024x}"
    assert '<html lang="zh"' in visitor.page.text


def test_the_page_to_delete_data_leads_back_to_the_consent_form_with_language_and_link(site: PageSite) -> None:
    visitor = Visitor(site)
    visitor.get(f"/s/small{link(1)}&lang=zh")
    visitor.get(address(visitor, "/withdraw"))
    assert '<html lang="zh"' in visitor.page.text
    visitor.get(address(visitor, r"/s/small\?"))
    assert '<html lang="zh"' in visitor.page.text
    assert visitor.fields("/consent")["PROLIFIC_PID"] == f"{1:024x}"


def test_a_network_from_which_too_many_came_is_tried_again_with_the_recruiters_link(
    site: PageSite, monkeypatch: pytest.MonkeyPatch
) -> None:
    def none_left(*_: object) -> None:
        raise EnrolmentLimitReached

    visitor = Visitor(site)
    visitor.get(f"/s/small{link(1)}")
    monkeypatch.setattr(progress, "enrol_within", none_left)
    assert visitor.send("/s/small/consent", visitor.fields("/consent") | {"box_0": "yes"}).status_code == 429
    (again,) = re.findall(r'class="btn" href="([^"]*)"', visitor.page.text)
    assert visitor.get(unescape(again)).status_code == 200
    assert visitor.fields("/consent")["PROLIFIC_PID"] == f"{1:024x}"
