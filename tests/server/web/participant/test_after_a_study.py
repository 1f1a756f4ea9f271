"""A closed study is not served after a restart. Participants still read their code and delete their data."""

import pytest

from server.store import interventions, participants
from tests.support.page_site import PageSite, Visitor
from tests.support.small_site import LINK, walk_to


def not_served(site: PageSite, name: str) -> None:
    """As after a restart: the versions of the database are known, and none of the study takes new participants."""
    site.studies._open.pop(name)


def finished(site: PageSite) -> tuple[Visitor, str, str]:
    """Somebody who finished a study that is no longer served: their browser, id and personal code."""
    visitor = Visitor(site)
    walk_to(visitor, site, "thanks")
    person = site.only("small")
    not_served(site, "small")
    return visitor, person.id, person.completion_code or ""


def is_stored(site: PageSite, person: str) -> bool:
    return site.database.read_now(participants.get, person) is not None


def test_data_are_deleted_by_code_when_the_study_is_not_served_any_more(site: PageSite) -> None:
    _, person, code = finished(site)
    other = Visitor(site)
    assert other.get("/s/small/withdraw").status_code == 200
    wrong = other.send("/s/small/withdraw", other.fields("/withdraw") | {"code": "KM-2222-2222"})
    assert (wrong.status_code, is_stored(site, person)) == (422, True)
    gone = other.send("/s/small/withdraw", other.fields("/withdraw") | {"code": code})
    assert "Your data have been deleted" in gone.text
    assert not is_stored(site, person)


def test_data_are_deleted_from_the_last_page_when_the_study_is_not_served_any_more(site: PageSite) -> None:
    visitor, person, code = finished(site)
    assert code in visitor.get("/s/small/now").text
    visitor.get("/s/small/withdraw")
    assert "Your data have been deleted" in visitor.send("/s/small/withdraw", visitor.fields("/withdraw")).text
    assert not is_stored(site, person)
    assert visitor.get("/s/small").status_code == 409, "the study has ended"


def test_the_study_link_leads_to_the_code_when_the_study_is_not_served_any_more(site: PageSite) -> None:
    visitor, _, code = finished(site)
    assert "you can see your completion code again" in visitor.get("/s/small").text
    assert code in visitor.get("/s/small/now").text
    assert "Are you the next person?" in visitor.get("/s/small/new").text
    assert "This study has ended" in visitor.send("/s/small/new", visitor.fields("/new")).text


def test_a_recruiters_link_leads_back_into_a_study_that_is_not_served_any_more(site: PageSite) -> None:
    visitor = Visitor(site)
    visitor.consent("hired", LINK)
    not_served(site, "hired")
    assert visitor.get(f"/s/hired{LINK}").url.path == "/s/hired/now"
    elsewhere = Visitor(site)
    assert elsewhere.consent("hired", LINK).url.path == "/s/hired/now"


def test_nobody_new_comes_into_a_study_that_is_not_served_any_more(site: PageSite) -> None:
    early = Visitor(site)
    early.get("/s/small")
    fields = early.fields("/consent") | {"box_0": "yes", "box_1": "yes", "box_2": "yes"}
    not_served(site, "small")
    page = Visitor(site).get("/s/small")
    assert (page.status_code, "This study has ended" in page.text) == (409, True)
    refused = early.send("/s/small/consent", fields)
    assert (refused.status_code, "This study has ended" in refused.text) == (409, True)
    assert early.get("/s/small/declined").status_code == 200, "somebody who has the consent page open may decline"
    assert Visitor(site).get("/s/never_stored").status_code == 404


def test_a_study_that_is_paused_and_closed_has_ended(site: PageSite) -> None:
    site.database.write_now(interventions.pause_study, "small", "anna")
    assert Visitor(site).get("/s/small").status_code == 503
    not_served(site, "small")
    assert Visitor(site).get("/s/small").status_code == 409


@pytest.mark.parametrize("status", ["timed_out", "screened_out", "returned"])
def test_a_participation_that_ended_early_is_not_called_completed(site: PageSite, status: str) -> None:
    visitor = Visitor(site)
    visitor.consent("hired", LINK)
    site.database.write_now(participants.leave, site.only("hired").id, status)
    elsewhere = Visitor(site)
    page = elsewhere.get(f"/s/hired{LINK}").text
    assert "The participation that belongs to this link has ended" in page
    assert "completed" not in page


def test_the_next_person_is_offered_a_code_only_where_there_is_one(site: PageSite) -> None:
    visitor = Visitor(site)
    visitor.consent("small")
    site.database.write_now(participants.leave, site.only("small").id, "timed_out")
    for address in ("/s/small", "/s/small/new"):
        page = visitor.get(address).text
        assert "Show the last page" in page
        assert "code" not in page.split("<main")[1]


def test_an_error_leads_back_to_a_study_that_is_not_served_any_more(site: PageSite) -> None:
    visitor = Visitor(site)
    walk_to(visitor, site, "everything")
    not_served(site, "small")
    page = visitor.send("/s/small/now", visitor.fields() | {"form_token": "expired"})
    assert page.status_code == 403
    assert 'class="btn" href="/s/small/now"' in page.text
