"""Prolific, MTurk and SONA by the study file alone: the parameters of their links, what goes back, what is never
shown.
"""

import re
from collections.abc import Iterator
from dataclasses import replace
from html import unescape
from urllib.parse import urlencode

import pytest

from server.participation.recruiter_links import recruitment_of, return_target
from server.store import participants
from server.store.attempts import LIMIT
from server.store.database import Database
from tests.support.page_site import SMALL_STUDY, PageSite, Visitor

CC = "https://app.prolific.com/submissions/complete?cc={code}"
SONA = "https://lab.sona-systems.com/webstudy_credit.aspx?experiment_id=7&credit_token=ab&survey_code={person}"
RECRUITMENTS = {
    "prolific": f'{{source: prolific, required: true, completed: {{code: DONE1, url: "{CC}"}}, '
    f'screened_out: {{code: OUT1, url: "{CC}"}}, declined: {{code: NO11, url: "{CC}"}}}}',
    "sona": f'{{source: sona, required: true, person_pattern: ".+", completed: {{url: "{SONA}"}}}}',
    "mturk": "{source: mturk, required: true}",
}
LINKS = {
    "prolific": "?PROLIFIC_PID=5f00000000000000000000a7&STUDY_ID=s1&SESSION_ID=x9",
    "sona": "?survey_code=41%2F7",
    "mturk": "?workerId=A1W1&assignmentId=A1&hitId=H1&turkSubmitTo=https%3A%2F%2Fworkersandbox.mturk.com",
}


@pytest.fixture(scope="module")
def site(tmp_path_factory: pytest.TempPathFactory) -> Iterator[PageSite]:
    texts = []
    for name, recruitment in RECRUITMENTS.items():
        text = SMALL_STUDY.replace("name: small", f"name: {name}", 1)
        texts.append(text.replace("seed: 11\n", f"seed: 11\nrecruitment: {recruitment}\n"))
    with PageSite(tmp_path_factory.mktemp("recruited"), *texts, SMALL_STUDY) as running:
        yield running


def finished(site: PageSite, name: str, query: str) -> Visitor:
    """Somebody who came by this link and is on the last page."""
    visitor = Visitor(site)
    visitor.consent(name, query)
    me = site.everybody(name)[-1]
    last = len(site.studies.steps_of(me)) - 2  # goodbye, the page before the last
    site.database.write_now(participants.advance, me.id, me.position, last)
    visitor.get(f"/s/{name}/now")
    visitor.submit(name)
    assert site.everybody(name)[-1].status == "completed"
    return visitor


def links(visitor: Visitor) -> list[str]:
    return [unescape(one) for one in re.findall(r'<a class="btn"[^>]* href="([^"]*)"', visitor.page.text)]


def test_prolific_gets_the_code_of_each_outcome(site: PageSite) -> None:
    assert links(finished(site, "prolific", LINKS["prolific"])) == [CC.replace("{code}", "DONE1")]
    unknown_visitor = Visitor(site)
    unknown_visitor.get(f"/s/prolific{LINKS['prolific']}")
    for page, code in (("declined", "NO11"), ("unsuitable", "OUT1")):
        unknown_visitor.get(f"/s/prolific/{page}{LINKS['prolific']}")
        assert (links(unknown_visitor), code in unknown_visitor.page.text) == ([CC.replace("{code}", code)], True)


def test_no_code_is_shown_before_everything_is_stored(site: PageSite) -> None:
    visitor = Visitor(site)
    visitor.consent("prolific", "?PROLIFIC_PID=5f00000000000000000000b8&STUDY_ID=s1&SESSION_ID=x9")
    me = site.everybody("prolific")[-1]
    site.database.write_now(participants.advance, me.id, me.position, len(site.studies.steps_of(me)) - 2)
    visitor.get("/s/prolific/now")
    services = site.services
    away = Database("postgresql://nobody@127.0.0.1:1/none", read_only=True)
    fields = visitor.fields()
    web = replace(services.web, database=HalfAway(services.web.database, away))
    site.use(replace(services, web=web))
    try:
        page = visitor.send("/s/prolific/now", fields)
    finally:
        site.use(services)
        away.close()
    assert (page.status_code, "DONE1" in page.text) == (503, False)
    assert site.everybody("prolific")[-1].status == "active"
    assert "DONE1" not in visitor.get("/s/prolific/now").text
    assert "DONE1" in visitor.send("/s/prolific/now", fields).text, "the same page, sent again, is taken"


class HalfAway:
    """A database that can be read, and not be written to."""

    def __init__(self, there: Database, away: Database) -> None:
        self.read, self.write = there.read, away.read


def test_sona_grants_the_credit_to_the_person(site: PageSite) -> None:
    assert links(finished(site, "sona", LINKS["sona"])) == [SONA.replace("{person}", "41%2F7")]


def test_mturk_gets_the_assignment_by_a_form_to_its_own_address(site: PageSite) -> None:
    visitor = finished(site, "mturk", LINKS["mturk"])
    code = site.everybody("mturk")[-1].completion_code or ""
    assert visitor.fields("/externalSubmit") == {"assignmentId": "A1", "code": code}
    assert 'action="https://workersandbox.mturk.com/mturk/externalSubmit"' in visitor.page.text
    assert "form-action 'self' https://workersandbox.mturk.com; " in (visitor.page.headers["content-security-policy"])


@pytest.mark.parametrize(
    "home",
    [
        "https://evil.example",
        "https://www.mturk.com.evil.example",
        "http://www.mturk.com",
        "https://me@www.mturk.com",
        "https://www.mturk.com:444",
        "https://xmturk.com",
        "https://www.mturk.com/elsewhere",
        "https://evil.test\\ * ; script-src-elem * 'unsafe-inline'; .mturk.com",
        "https://[x.mturk.com",
        "https://evil.test#.mturk.com",
        "https://anything.mturk.com",
        "https://www.mturk.com//",
        "javascript:alert(1)//.mturk.com",
        "",
    ],
)
def test_no_form_goes_to_an_address_that_is_not_mturks(site: PageSite, home: str) -> None:
    found = site.studies.open("mturk")
    assert found is not None
    recruitment = found[1].recruitment
    values = {"assignmentId": "A1", "code": "KM-2222-2222", "person": "A1W1"}
    assert return_target(recruitment, recruitment.completed, values | {"turkSubmitTo": home}) is None
    assert "turkSubmitTo" not in recruitment_of(recruitment, {"workerId": "W1", "turkSubmitTo": home})[1]
    good = return_target(recruitment, recruitment.completed, values | {"turkSubmitTo": "https://WWW.mturk.com/"})
    assert good is not None
    assert good.url == "https://www.mturk.com/mturk/externalSubmit"


@pytest.mark.parametrize(
    "home", ["https://evil.test\\ * ; script-src-elem * 'unsafe-inline'; .mturk.com", "https://[x.mturk.com"]
)
def test_a_crafted_mturk_link_ends_with_the_code_and_sends_it_to_nobody(site: PageSite, home: str) -> None:
    query = urlencode({"workerId": f"ACRAFTED{len(home)}", "assignmentId": "A9", "hitId": "H1", "turkSubmitTo": home})
    visitor = finished(site, "mturk", f"?{query}")
    me = site.everybody("mturk")[-1]
    assert visitor.page.status_code == 200
    assert (me.completion_code or "?") in visitor.page.text
    assert "externalSubmit" not in visitor.page.text
    policy = visitor.page.headers["content-security-policy"]
    assert "evil" not in policy
    assert "unsafe" not in policy
    assert "turkSubmitTo" not in site.database.read_now(participants.personal_of, me.id)


def test_a_preview_of_the_assignment_asks_to_accept_it(site: PageSite) -> None:
    page = Visitor(site).get("/s/mturk?assignmentId=ASSIGNMENT_ID_NOT_AVAILABLE&hitId=H1")
    assert "Please accept the assignment first." in page.text
    assert "<form" not in page.text.replace('class="tongues"', "")
    assert "frame-ancestors https://*.mturk.com" in page.headers["content-security-policy"]


def test_in_mturks_frame_the_study_opens_in_a_tab_of_its_own(site: PageSite) -> None:
    framed = Visitor(site, {"sec-fetch-dest": "iframe"})
    framed.get(f"/s/mturk{LINKS['mturk']}")
    assert links(framed) == [f"/s/mturk{LINKS['mturk']}&lang=en"]
    assert "frame-ancestors https://*.mturk.com" in framed.page.headers["content-security-policy"]
    other = Visitor(site, {"sec-fetch-dest": "iframe"}).get("/s/small")
    assert "frame-ancestors 'none'" in other.headers["content-security-policy"]


@pytest.mark.parametrize("name", RECRUITMENTS)
def test_a_link_without_the_person_is_refused_and_the_same_person_is_one_row(site: PageSite, name: str) -> None:
    assert Visitor(site).get(f"/s/{name}").status_code == 400
    query = LINKS[name].replace("00a7", "00c9").replace("41%2F7", "again").replace("A1W1", "A1AGAIN")
    before = len(site.everybody(name))
    for _ in range(3):
        Visitor(site).consent(name, query)
    assert len(site.everybody(name)) == before + 1


def test_codes_cannot_be_guessed(site: PageSite) -> None:
    right = finished(site, "sona", "?survey_code=leaver")
    code = site.everybody("sona")[-1].completion_code or ""
    guessing = Visitor(site)
    guessing.get("/s/sona/withdraw")
    fields = guessing.fields("/withdraw")
    answers = [guessing.send("/s/sona/withdraw", fields | {"code": f"KM-{n}"}).status_code for n in range(LIMIT + 1)]
    assert answers == [422] * LIMIT + [429]
    late = guessing.send("/s/sona/withdraw", fields | {"code": code})
    assert (late.status_code, "Too many codes were wrong" in late.text) == (429, True)
    before = len(site.everybody("sona"))
    right.get("/s/sona/withdraw")
    right.send("/s/sona/withdraw", right.fields("/withdraw"))
    assert len(site.everybody("sona")) == before - 1, "who has the cookie needs no code"
