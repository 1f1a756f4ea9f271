"""Somebody whom a recruiter sends to a study that is full or closed is led back: nothing is stored of them."""

from collections.abc import Iterator
from pathlib import Path

import pytest

from server.web.participant import study_pages
from tests.server.web.participant.test_filling_a_study import ONE_EACH
from tests.server.web.participant.test_recruiters import CC, RECRUITMENTS, links
from tests.support.page_site import SMALL_STUDY, PageSite, Visitor

PAID = ONE_EACH.replace("seed: 11\n", f"seed: 11\nrecruitment: {RECRUITMENTS['prolific']}\n")
UNPAID = SMALL_STUDY.replace("name: small", "name: unpaid", 1)


@pytest.fixture
def site(tmp_path: Path) -> Iterator[PageSite]:
    with PageSite(tmp_path, PAID, UNPAID) as running:
        yield running


def link(number: int) -> str:
    return f"?PROLIFIC_PID={number:024x}&STUDY_ID=s1&SESSION_ID=x9"


def closes(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(study_pages.study_openings, "closed", lambda _: {"small", "unpaid"})


def test_a_full_study_gives_the_code_and_the_link_with_which_a_submission_is_returned(site: PageSite) -> None:
    for number in (1, 2):
        assert Visitor(site).consent("small", link(number)).status_code == 200
    late = Visitor(site)
    assert late.consent("small", link(3)).status_code == 409
    assert "All places are taken" in late.page.text
    assert "Your return code" in late.page.text
    assert links(late) == [CC.replace("{code}", "NO11")]
    assert len(site.everybody("small")) == 2


def test_a_closed_study_gives_them_too(site: PageSite, monkeypatch: pytest.MonkeyPatch) -> None:
    closes(monkeypatch)
    late = Visitor(site)
    assert late.get(f"/s/small{link(3)}").status_code == 409
    assert links(late) == [CC.replace("{code}", "NO11")]


def test_a_study_without_a_recruiter_leads_to_the_start_page(site: PageSite, monkeypatch: pytest.MonkeyPatch) -> None:
    closes(monkeypatch)
    late = Visitor(site)
    assert late.get("/s/unpaid").status_code == 409
    assert "code" not in late.page.text.split("<main", 1)[1].split("</main", 1)[0]
    assert 'href="/"' in late.page.text


def test_somebody_who_declines_gets_a_code_to_return_and_not_one_of_completion(site: PageSite) -> None:
    visitor = Visitor(site)
    visitor.get(f"/s/small/declined{link(4)}")
    assert "Your return code" in visitor.page.text
    assert "Your completion code" not in visitor.page.text
