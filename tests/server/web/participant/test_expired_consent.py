"""Consent pages that were open for too long or since before another tab consented, and sessions that have ended."""

import re
import time
from pathlib import Path

import pytest

from server.web.csrf import FORM_S, NOBODY, CsrfProtection
from tests.support.page_site import SECRET, PageSite, Visitor
from tests.support.small_site import LINK, PROLIFIC

OTHER_LINK = LINK.replace("00001", "00002")
EXPIRED = "This page was no longer up to date"
SESSION_OVER = "Your session in this browser has ended"


def expired_fields(visitor: Visitor) -> dict[str, str]:
    """The fields of the consent page on the screen, as if it had been there since yesterday."""
    old = CsrfProtection(SECRET).form_token(NOBODY, time.time() - FORM_S - 60)
    return visitor.fields("/consent") | {"form_token": old}


@pytest.mark.parametrize("query", ["", "?lang=zh"])
def test_an_expired_form_is_shown_again_with_its_ticks(site: PageSite, query: str) -> None:
    visitor = Visitor(site)
    visitor.get(f"/s/small{query}")
    answer = visitor.send("/s/small/consent", expired_fields(visitor) | {"box_0": "yes"})
    assert answer.status_code == 403
    assert ("此页面已过期" if query else EXPIRED) in answer.text
    assert re.search(r'name="box_0" value="yes" required\s+checked', answer.text)
    assert site.everybody("small") == []
    visitor.send("/s/small/consent", visitor.fields("/consent") | {"box_0": "yes"})
    assert visitor.page.url.path == "/s/small/now"
    assert site.only("small").language == ("zh" if query else "en")


def test_the_recruiters_parameters_survive_an_expired_form(site: PageSite) -> None:
    visitor = Visitor(site)
    visitor.get(f"/s/hired{LINK}")
    visitor.send("/s/hired/consent", expired_fields(visitor))
    assert 'id="boxes-missing"' in visitor.page.text
    visitor.send("/s/hired/consent", visitor.fields("/consent") | {"box_0": "yes"})
    again = Visitor(site)
    assert "Welcome back" in again.get(f"/s/hired{LINK}").text, "the participant is known by the recruiter's id"


def test_an_expired_welcome_back_is_shown_again(site: PageSite) -> None:
    Visitor(site).consent("hired", LINK)
    again = Visitor(site)
    again.get(f"/s/hired{LINK}")
    answer = again.send("/s/hired/consent", expired_fields(again))
    assert (answer.status_code, "Welcome back" in answer.text) == (403, True)
    assert again.send("/s/hired/consent", again.fields("/consent")).url.path == "/s/hired/now"
    assert len(site.everybody("hired")) == 1


def test_the_page_of_an_older_tab_leads_to_where_the_participant_is(site: PageSite) -> None:
    visitor = Visitor(site)
    visitor.get("/s/small")
    older_tab = visitor.fields("/consent") | {"box_0": "yes"}
    visitor.consent("small")
    assert visitor.send("/s/small/consent", older_tab).url.path == "/s/small/now"
    assert len(site.everybody("small")) == 1


def test_a_second_person_in_the_same_browser_does_not_continue_as_the_first(site: PageSite) -> None:
    visitor = Visitor(site)
    visitor.get(f"/s/hired{OTHER_LINK}")
    older_tab = visitor.fields("/consent") | {"box_0": "yes"}
    visitor.consent("hired", LINK)
    answer = visitor.send("/s/hired/consent", older_tab)
    assert (answer.status_code, EXPIRED in answer.text) == (403, True)
    visitor.send("/s/hired/consent", visitor.fields("/consent") | {"box_0": "yes"})
    assert visitor.page.url.path == "/s/hired/now"
    assert len(site.everybody("hired")) == 2


@pytest.mark.parametrize("broken", [{"visit": ""}, {"visit": "x" * 65}])
def test_a_form_that_was_never_ours_is_refused(site: PageSite, broken: dict[str, str]) -> None:
    visitor = Visitor(site)
    visitor.get("/s/small")
    answer = visitor.send("/s/small/consent", expired_fields(visitor) | broken)
    assert (answer.status_code, EXPIRED in answer.text) == (403, False)


@pytest.mark.parametrize("required", [True, False])
def test_a_device_that_another_one_has_replaced_asks_for_the_link_and_not_for_a_new_consent(
    tmp_path: Path, required: bool
) -> None:
    text = PROLIFIC if required else PROLIFIC.replace("required: true", "required: false")
    with PageSite(tmp_path, text) as site:
        first, second = Visitor(site), Visitor(site)
        first.consent("hired", LINK)
        second.consent("hired", LINK)
        page = first.get("/s/hired/now")
        assert SESSION_OVER in page.text
        assert ("box_0" in page.text) != required
        assert SESSION_OVER not in Visitor(site).get("/s/hired").text, "somebody new"
        assert SESSION_OVER not in first.get(f"/s/hired{LINK}").text
        assert "Welcome back" in first.page.text
