"""The start page and consent: what is offered, what is stored and when."""

import re
from pathlib import Path

import pytest
from sqlalchemy import text as sql

from server.store import participants
from tests.support.page_site import SMALL_STUDY, PageSite, Visitor
from tests.support.small_site import LINK, rows


def test_start_page_offers_the_studies(site: PageSite) -> None:
    page = Visitor(site).get("/")
    assert page.status_code == 200
    assert 'href="/s/small?lang=en"' in page.text


@pytest.mark.parametrize(("minutes", "said"), [(1, "About 1 minute<"), (2, "About 2 minutes<")])
def test_start_page_counts_minutes_as_people_do(tmp_path: Path, minutes: int, said: str) -> None:
    with PageSite(tmp_path, re.sub(r"duration_min: \d+", f"duration_min: {minutes}", SMALL_STUDY)) as site:
        assert said in Visitor(site).get("/").text


BLOCKS = "factors: {prediction: [none, tom]}\ncells: {within: [prediction]}\n"
CONDITIONS = "conditions:\n  - {name: without, predictor: none}\n  - {name: with, predictor: tom}\n"


@pytest.mark.parametrize(("old", "new", "said"), [("", "", 4), (CONDITIONS, BLOCKS, 8), (" episodes,", "", None)])
def test_start_page_counts_the_rounds_that_are_played(tmp_path: Path, old: str, new: str, said: int | None) -> None:
    assert old in SMALL_STUDY
    with PageSite(tmp_path, SMALL_STUDY.replace(old, new, 1)) as site:
        page = Visitor(site).get("/").text
        assert re.findall(r"(\d+) rounds?<", page) == ([] if said is None else [str(said)])
        assert ("2 kitchens" in page) == (said is not None), "the kitchens of rounds that nobody plays"


def test_nothing_is_stored_and_no_cookie_is_set_before_consent(site: PageSite) -> None:
    before = rows(site)
    visitor = Visitor(site)
    for path in ("/", "/s/small", "/s/small/now", "/s/small/unsuitable", "/s/small/declined", "/s/small/withdraw"):
        assert visitor.get(path).status_code == 200
    for _ in range(5):
        visitor.get(f"/s/hired{LINK}")
    assert rows(site) == before
    assert not visitor.client.cookies


def test_consent_makes_one_participant_with_a_protected_cookie(site: PageSite) -> None:
    visitor = Visitor(site)
    visitor.get("/s/small")
    fields = visitor.fields("/consent") | {"box_0": "yes"}
    answer = visitor.client.post("/s/small/consent", data=fields, follow_redirects=False)
    assert (answer.status_code, answer.headers["location"]) == (303, "/s/small/now")
    cookie = answer.headers["set-cookie"]
    assert re.match(r"participant=[0-9a-f]{64};", cookie)
    assert all(word in cookie for word in ("HttpOnly", "Path=/s/small", "SameSite=lax"))
    token = visitor.client.cookies["participant"]
    stored = site.database.read_now(
        lambda connection: connection.execute(sql("select token_hash from participants")).scalar()
    )
    assert stored == participants.token_hash(token) != token


def test_consent_page_sent_twice_makes_one_participant(site: PageSite) -> None:
    visitor = Visitor(site)
    visitor.get("/s/small")
    fields = visitor.fields("/consent") | {"box_0": "yes"}
    for _ in range(3):
        again = Visitor(site)
        assert again.send("/s/small/consent", fields).url.path == "/s/small/now"
    assert len(site.everybody("small")) == 1


def test_consent_page_sent_again_after_its_answer_was_lost_continues(site: PageSite) -> None:
    """The response set the cookie, then the connection broke: the page in the browser is older than the cookie."""
    visitor = Visitor(site)
    visitor.get("/s/small")
    fields = visitor.fields("/consent") | {"box_0": "yes"}
    assert visitor.send("/s/small/consent", fields).url.path == "/s/small/now"
    assert visitor.client.cookies
    assert visitor.send("/s/small/consent", fields).url.path == "/s/small/now"
    assert len(site.everybody("small")) == 1


def test_consent_without_every_box_is_refused_and_stores_nothing(site: PageSite) -> None:
    visitor = Visitor(site)
    visitor.get("/s/small")
    answer = visitor.send("/s/small/consent", visitor.fields("/consent"))
    assert answer.status_code == 422
    assert "Please tick every box" in answer.text
    assert site.everybody("small") == []
