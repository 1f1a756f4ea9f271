"""Returning participants, by which link and in which browser: what a recruiter's id gives access to, and what not."""

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from urllib.parse import quote

import pytest

from server.participation.recruiter_links import recruitment_of
from server.store import overview, participants
from server.store.tables import RECRUITMENT_ID
from server.store.tables import participants as table
from server.web.auth import BOT_MARK, bot_mark
from tests.support.page_site import SMALL_STUDY, PageSite, Visitor

CC = "https://app.prolific.com/submissions/complete?cc={code}"
RECRUITMENTS = {
    "prolific": f'{{source: prolific, required: true, completed: {{code: C1ABC, url: "{CC}"}}}}',
    "mturk": "{source: mturk, required: true}",
    "lab": "{source: none, person: participant}",
}
ONE, OTHER = "5f1e0000000000000000000a", "5f1e0000000000000000000b"


@pytest.fixture
def site(tmp_path: Path) -> Iterator[PageSite]:
    texts = [SMALL_STUDY]
    for name, recruitment in RECRUITMENTS.items():
        text = SMALL_STUDY.replace("name: small", f"name: {name}", 1)
        texts.append(text.replace("seed: 11\n", f"seed: 11\nrecruitment: {recruitment}\n"))
    with PageSite(tmp_path, *texts) as running:
        yield running


def prolific(person: str = ONE, session: str = "x1") -> str:
    return f"?PROLIFIC_PID={person}&STUDY_ID=s1&SESSION_ID={session}"


def mturk(assignment: str, worker: str = "A1W1") -> str:
    return f"?workerId={worker}&assignmentId={assignment}&hitId=H1&turkSubmitTo=https%3A%2F%2Fwww.mturk.com"


def finish(site: PageSite, visitor: Visitor, name: str) -> str:
    """From wherever they are to the last page; returns the personal code."""
    me = site.everybody(name)[-1]
    site.database.write_now(participants.advance, me.id, me.position, len(site.studies.steps_of(me)) - 2)
    visitor.get(f"/s/{name}/now")
    visitor.submit(name)
    code = site.everybody(name)[-1].completion_code
    assert code
    return code


def put(site: PageSite, status: str, code: str | None = None) -> None:
    values = {"status": status, "completion_code": code}
    site.database.write_now(lambda connection: connection.execute(table.update().values(values)))


# The id alone gives no access to a finished participation


def test_with_the_id_alone_nobody_reads_the_code_of_somebody_who_finished(site: PageSite) -> None:
    owner, unknown_visitor = Visitor(site), Visitor(site)
    owner.consent("prolific", prolific())
    fields = consent_form(unknown_visitor)
    code = finish(site, owner, "prolific")
    page = unknown_visitor.get(f"/s/prolific{prolific()}")
    assert "You have already taken part" in page.text
    answer = unknown_visitor.send("/s/prolific/consent", fields)
    assert answer.status_code == 409
    assert not unknown_visitor.client.cookies
    for text in (page.text, answer.text):
        assert code not in text
        assert "C1ABC" not in text
    assert code in owner.get("/s/prolific/now").text, "the browser that took part is not signed out"


def consent_form(visitor: Visitor) -> dict[str, str]:
    """A consent form that was opened while the person was still taking part."""
    visitor.get(f"/s/prolific{prolific()}")
    return visitor.fields("/consent") | {"box_0": "yes"}


@pytest.mark.parametrize("status", ["completed", "screened_out", "timed_out", "returned"])
def test_no_participation_that_is_over_is_taken_over_or_deleted_by_its_id(site: PageSite, status: str) -> None:
    Visitor(site).consent("prolific", prolific())
    put(site, status, "KM-2222-3333")
    unknown_visitor = Visitor(site)
    unknown_visitor.get(f"/s/prolific{prolific()}")
    assert "KM-2222-3333" not in unknown_visitor.page.text
    unknown_visitor.get("/s/prolific/withdraw")
    unknown_visitor.send("/s/prolific/withdraw", unknown_visitor.fields("/withdraw") | {"code": ONE})
    assert site.only("prolific").status == status


def test_an_active_participant_continues_on_another_device(site: PageSite) -> None:
    Visitor(site).consent("prolific", prolific())
    again = Visitor(site)
    again.consent("prolific", prolific())
    assert again.page.url.path == "/s/prolific/now"
    assert site.only("prolific").status == "active"


def test_the_browser_that_took_part_sees_the_code_again_by_the_link(site: PageSite) -> None:
    owner = Visitor(site)
    owner.consent("prolific", prolific())
    code = finish(site, owner, "prolific")
    assert code in owner.get(f"/s/prolific{prolific()}").text


def test_data_are_deleted_by_the_personal_code_and_a_code_of_all_is_explained(site: PageSite) -> None:
    owner, peers = Visitor(site), Visitor(site)
    owner.consent("prolific", prolific())
    code = finish(site, owner, "prolific")
    assert f"Your personal code is {code}" in owner.page.text
    peers.get("/s/prolific/withdraw")
    assert "Your personal code" in peers.page.text
    fields = peers.fields("/withdraw")
    for _ in range(20):  # no guess, so it locks nobody out
        answer = peers.send("/s/prolific/withdraw", fields | {"code": "c1abc"})
        assert answer.status_code == 422
        assert "everybody gets for the sign-up site" in answer.text
    assert peers.send("/s/prolific/withdraw", fields | {"code": f" {code.lower()} "}).status_code == 200
    assert site.everybody("prolific") == []


# The next person in the same browser


def test_the_next_person_in_the_same_browser_starts_as_a_new_participant(site: PageSite) -> None:
    browser = Visitor(site)
    browser.consent("small")
    code = finish(site, browser, "small")
    assert 'href="/s/small/new"' in browser.page.text
    page = browser.get("/s/small")
    assert page.status_code == 200
    assert code not in page.text
    assert "Start as a new participant" in page.text
    assert code in browser.get("/s/small/now").text, "a participant finds the code"
    browser.get("/s/small")
    answer = browser.send("/s/small/new", browser.fields("/new"))
    assert answer.url.path == "/s/small"
    assert answer.history[0].headers["clear-site-data"] == '"storage"'
    assert "I agree" in answer.text
    browser.consent("small")
    first, second = site.everybody("small")
    assert (first.status, second.status) == ("completed", "active")
    assert (first.completion_code, second.position) == (code, 0)


def test_the_next_person_starts_new_also_after_a_participant_who_left_in_the_middle(site: PageSite) -> None:
    browser = Visitor(site)
    browser.consent("small")
    assert 'href="/s/small/new"' in browser.page.text
    assert browser.get("/s/small").url.path == "/s/small/now", "a reload continues"
    browser.get("/s/small/new")
    assert "Continue where I was" in browser.page.text
    browser.send("/s/small/new", browser.fields("/new"))
    browser.consent("small")
    assert [one.status for one in site.everybody("small")] == ["active", "active"]


def test_a_foreign_page_makes_nobody_a_new_participant(site: PageSite) -> None:
    browser = Visitor(site)
    browser.consent("small")
    browser.send("/s/small/new", {})
    assert browser.page.status_code == 403
    assert browser.get("/s/small/now").url.path == "/s/small/now"


@pytest.mark.parametrize("name", ["prolific", "lab"])
def test_where_people_have_ids_nobody_starts_over_without_a_link_of_their_own(site: PageSite, name: str) -> None:
    query = {"prolific": prolific(), "lab": "?participant=seat-7"}[name]
    browser = Visitor(site)
    browser.consent(name, query)
    finish(site, browser, name)
    assert "/new" not in browser.page.text
    browser.get("/s/small")
    browser.send(f"/s/{name}/new", browser.fields("/consent"))
    assert browser.get(f"/s/{name}").url.path == f"/s/{name}/now"


# What a link brings


def kept(site: PageSite, name: str) -> dict[str, str]:
    return site.database.read_now(participants.personal_of, site.only(name).id)


@pytest.mark.parametrize("has_cookie", [True, False])
def test_a_hit_that_is_accepted_again_submits_the_new_assignment(site: PageSite, has_cookie: bool) -> None:
    worker = Visitor(site)
    worker.consent("mturk", mturk("FIRST"))
    if not has_cookie:
        worker = Visitor(site)
    worker.get(f"/s/mturk{mturk('ASSIGNMENT_ID_NOT_AVAILABLE')}")
    assert "Please accept the assignment first." in worker.page.text or has_cookie
    assert "Welcome back" in worker.get(f"/s/mturk{mturk('SECOND')}").text
    assert kept(site, "mturk")["assignmentId"] == "FIRST", "a GET changes nothing"
    worker.send("/s/mturk/consent", worker.fields("/consent"))
    assert kept(site, "mturk")["assignmentId"] == "SECOND"
    finish(site, worker, "mturk")
    assert worker.fields("/externalSubmit")["assignmentId"] == "SECOND"


def test_a_hit_that_is_accepted_again_after_the_end_submits_the_new_assignment(site: PageSite) -> None:
    worker = Visitor(site)
    worker.consent("mturk", mturk("FIRST"))
    code = finish(site, worker, "mturk")
    worker.get(f"/s/mturk{mturk('SECOND')}")
    worker.send("/s/mturk/consent", worker.fields("/consent"))
    assert worker.fields("/externalSubmit") == {"assignmentId": "SECOND", "code": code}


def test_a_new_session_of_prolific_takes_the_place_of_the_old_one_and_nothing_else_is_lost(site: PageSite) -> None:
    Visitor(site).consent("prolific", prolific(session="x1"))
    again = Visitor(site)
    again.get(f"/s/prolific?PROLIFIC_PID={ONE}&SESSION_ID=x2")
    again.send("/s/prolific/consent", again.fields("/consent"))
    assert kept(site, "prolific") == {RECRUITMENT_ID: ONE, "STUDY_ID": "s1", "SESSION_ID": "x2"}
    assert again.get(f"/s/prolific{prolific(session='x2')}").url.path == "/s/prolific/now", "nothing new: straight on"


PLACEHOLDERS = [
    "{{%PROLIFIC_PID%}}", "{{PROLIFIC_PID}}", "{{%PROLIFIC_PID%", "%PROLIFIC_PID%", "%%PROLIFIC_PID%%", "${workerId}",
    "{participant}", "<id>", "[id]", "%7B%7B%25PROLIFIC_PID%25%7D%7D",
]  # fmt: skip


@pytest.mark.parametrize("value", PLACEHOLDERS)
def test_a_placeholder_that_was_not_replaced_is_not_an_id(site: PageSite, value: str) -> None:
    assert Visitor(site).get(f"/s/prolific?PROLIFIC_PID={quote(value)}").status_code == 400
    for name in RECRUITMENTS:
        found = site.studies.open(name)
        assert found is not None
        recruitment = found[1].recruitment
        given = {str(recruitment.person_parameter): value} | dict.fromkeys(recruitment.extra_parameters, value)
        assert recruitment_of(recruitment, given) == (None, {})


def test_people_with_a_placeholder_are_not_taken_for_one_person(site: PageSite) -> None:
    for _ in range(2):
        Visitor(site).consent("lab", f"?participant={quote('{{%PROLIFIC_PID%}}')}")
    assert len(site.everybody("lab")) == 2


@pytest.mark.parametrize("name", ["prolific_pid", "Prolific_Pid", "PROLIFIC_pid"])
def test_a_parameter_s_name_counts_in_any_case(site: PageSite, name: str) -> None:
    Visitor(site).consent("prolific", f"?{name}={ONE}&study_id=s1&session_id=x1")
    assert kept(site, "prolific") == {RECRUITMENT_ID: ONE, "STUDY_ID": "s1", "SESSION_ID": "x1"}
    Visitor(site).consent("prolific", prolific())
    assert len(site.everybody("prolific")) == 1


@pytest.mark.parametrize(
    ("name", "person", "is_one"),
    [
        ("prolific", ONE, True),
        ("prolific", ONE.upper(), True),
        ("prolific", "me", False),
        ("prolific", ONE + "0", False),
        ("prolific", ONE[:-1], False),
        ("prolific", "g" * 24, False),
        ("prolific", f"{ONE}\n", True),
        ("mturk", "A2SUAM1J3GNN3B", True),
        ("mturk", "me", False),
        ("mturk", "A2SUAM1J3GNN3B; --", False),
        ("lab", "seat 7", True),
    ],
)
def test_an_id_has_to_look_like_one_of_the_recruiter_s(site: PageSite, name: str, person: str, is_one: bool) -> None:
    found = site.studies.open(name)
    assert found is not None
    recruitment = found[1].recruitment
    taken, _ = recruitment_of(recruitment, {str(recruitment.person_parameter): person})
    assert (taken is not None) == is_one
    assert taken is None or taken == (person.strip().lower() if name == "prolific" else person)


# Bots


@pytest.mark.parametrize(
    ("production", "mark", "is_bot"),
    [(False, "", True), (True, "", False), (True, "yes", False), (True, "right", True), (False, "wrong", True)],
)
def test_on_a_public_server_only_clients_with_its_secret_count_as_bots(
    site: PageSite, production: bool, mark: str, is_bot: bool
) -> None:
    web = replace(site.services.web, production=production)
    site.use(replace(site.services, web=web))
    visitor = Visitor(site)
    visitor.get("/s/small")
    fields = visitor.fields("/consent") | {"box_0": "yes", "simulated": "yes"}
    if mark:
        fields[BOT_MARK] = bot_mark(web.csrf.secret, fields["visit"]) if mark == "right" else mark
    visitor.send("/s/small/consent", fields)
    assert site.only("small").simulated is is_bot
    assert site.database.read_now(overview.simulated, (site.only("small").study_id,)) == is_bot, "the dashboard says it"
