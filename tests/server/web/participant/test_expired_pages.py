"""Pages that were open for longer than a form counts: nothing is stored, and nothing that was typed is lost."""

import re
import time

import pytest

from server.store import answers
from server.web.auth import cookie_name
from server.web.csrf import FORM_S, CsrfProtection
from tests.support.page_site import SECRET, PageSite, Visitor
from tests.support.small_site import walk_to

EXPIRED = {"en": "This page was open for too long", "zh": "此页面打开时间过长"}


def token_since_yesterday(visitor: Visitor) -> str:
    """What the page on the screen would carry if it had been there since yesterday."""
    session = visitor.client.cookies[cookie_name("participant", secure=False)]
    return CsrfProtection(SECRET).form_token(session, time.time() - FORM_S - 60)


def answers_of(site: PageSite) -> dict[str, object]:
    """The stored answers on the page that asks everything."""
    return site.database.read_now(answers.of_participant, site.only("small").id).get("everything", {})


@pytest.mark.parametrize("language", ["en", "zh"])
def test_answers_of_an_expired_page_are_shown_again_and_count_when_they_are_sent_again(
    site: PageSite, language: str
) -> None:
    visitor = Visitor(site, {"accept-language": language})
    walk_to(visitor, site, "everything")
    typed = {"words": "what took me an hour", "mood": "3"}
    page = visitor.send("/s/small/now", visitor.fields() | typed | {"form_token": token_since_yesterday(visitor)})
    assert page.status_code == 403
    assert EXPIRED[language] in page.text
    assert "what took me an hour" in page.text
    assert re.search(r'name="mood" value="3"[^>]*checked', page.text)
    assert answers_of(site) == {}
    sent = visitor.send("/s/small/now", visitor.fields() | typed)
    assert sent.status_code == 422, "an ordinary page again: other questions are open"
    assert EXPIRED[language] not in sent.text


def test_an_expired_page_without_questions_is_shown_again(site: PageSite) -> None:
    visitor = Visitor(site)
    walk_to(visitor, site, "introduction")
    before = site.step(site.only("small")).key
    page = visitor.send("/s/small/now", visitor.fields() | {"form_token": token_since_yesterday(visitor)})
    assert (page.status_code, EXPIRED["en"] in page.text) == (403, True)
    assert site.step(site.only("small")).key == before
    visitor.send("/s/small/now", visitor.fields())
    assert site.step(site.only("small")).key != before


def test_an_expired_page_of_an_earlier_step_leads_to_the_current_one(site: PageSite) -> None:
    visitor = Visitor(site)
    walk_to(visitor, site, "introduction")
    older_tab = visitor.fields()
    visitor.send("/s/small/now", older_tab)
    key = site.step(site.only("small")).key
    page = visitor.send("/s/small/now", older_tab | {"form_token": token_since_yesterday(visitor)})
    assert (page.status_code, EXPIRED["en"] in page.text) == (200, False)
    assert site.step(site.only("small")).key == key


def test_what_somebody_else_typed_in_the_same_browser_is_not_shown(site: PageSite) -> None:
    visitor = Visitor(site)
    walk_to(visitor, site, "everything")
    old = CsrfProtection(SECRET).form_token("the session of another person", time.time() - FORM_S - 60)
    page = visitor.send("/s/small/now", visitor.fields() | {"words": "a secret", "form_token": old})
    assert (page.status_code, "a secret" in page.text, EXPIRED["en"] in page.text) == (403, False, False)


def test_a_program_is_told_that_its_form_has_expired(site: PageSite) -> None:
    visitor = Visitor(site)
    visitor.consent("small")
    fields = visitor.fields() | {"form_token": token_since_yesterday(visitor)}
    visitor.client.headers["accept"] = "application/json"
    answer = visitor.send("/s/small/now", fields)
    assert (answer.status_code, list(answer.json())) == (403, ["detail"])
