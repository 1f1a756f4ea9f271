"""How a participation can end early: a device, a quiz, withdrawal, a freed place."""

import re
from pathlib import Path

from sqlalchemy import select
from sqlalchemy import text as sql

from server.store import events, participants
from server.store.tables import withdrawals
from tests.support.page_site import EVERYTHING, SMALL_STUDY, PageSite, Visitor
from tests.support.small_site import rows, walk_to


def test_finished_person_cannot_start_over(site: PageSite) -> None:
    visitor = Visitor(site)
    walk_to(visitor, site, "thanks")
    code = site.only("small").completion_code
    assert code in visitor.get("/s/small/now").text
    assert code not in visitor.get("/s/small").text, "the next person in this browser does not read it"
    leaving = visitor.get("/s/small/withdraw").text
    assert "No, keep my data" in leaving
    assert "go back to the study" not in leaving
    assert visitor.send("/s/small/now", {}).status_code == 403
    assert len(site.everybody("small")) == 1


def test_unsuitable_device_gets_the_screened_out_code(site: PageSite) -> None:
    page = Visitor(site).get("/s/hired/unsuitable").text
    assert ">C2DEF</output>" in page
    assert "complete?cc=C2DEF" in page
    assert "Your return code" in page
    assert "completion code" not in page, "the person completed nothing"


def test_quiz_is_repeated_until_right_and_failures_are_noted(site: PageSite) -> None:
    visitor = Visitor(site)
    walk_to(visitor, site, "quiz")
    visitor.get("/s/small/now")
    assert visitor.submit("small", onions="two").status_code == 422
    assert "That is not right" in visitor.page.text
    assert site.step(site.only("small")).key == "quiz"
    visitor.submit("small", onions="three")
    assert site.step(site.only("small")).key == "tutorial"
    failed = site.database.read_now(events.of_participant, site.only("small").id, "quiz_failed")
    assert [event.detail for event in failed] == [{"answers": {"onions": "two"}, "attempt": 1}]


def test_the_text_of_a_quiz_with_one_attempt_is_in_the_singular(tmp_path: Path) -> None:
    with PageSite(tmp_path, re.sub(r"attempts: \d+", "attempts: 1", SMALL_STUDY)) as site:
        visitor = Visitor(site)
        walk_to(visitor, site, "quiz")
        assert "You have one try." in visitor.get("/s/small/now").text


def test_quiz_failed_too_often_ends_the_study_and_frees_the_place(site: PageSite) -> None:
    visitor = Visitor(site)
    walk_to(visitor, site, "quiz")
    for _ in range(3):
        visitor.get("/s/small/now")
        visitor.submit("small", onions="two")
    assert site.only("small").status == "screened_out"
    assert "The study ends here" in visitor.get("/s/small/now").text


def test_failed_attention_check_is_taken_and_noted(site: PageSite) -> None:
    visitor = Visitor(site)
    visitor.consent("small")
    visitor.submit("small", **(EVERYTHING | {"check": "7"}))
    assert site.step(site.only("small")).key == "introduction"
    noted = site.database.read_now(events.of_participant, site.only("small").id, "attention_failed")
    assert [event.detail for event in noted] == [{"step": "everything", "questions": ["check"]}]


def test_withdrawal_deletes_the_participant_and_leaves_a_count(site: PageSite) -> None:
    visitor = Visitor(site)
    walk_to(visitor, site, "ready-02")
    before = site.only("small").id
    visitor.get("/s/small/withdraw")
    page = visitor.send("/s/small/withdraw", visitor.fields("/withdraw"))
    assert "Your data have been deleted" in page.text
    assert site.everybody("small") == []
    assert rows(site)["withdrawals"] == 1
    assert site.database.read_now(lambda connection: connection.scalar(select(withdrawals.c.simulated))) is False
    assert rows(site)["answers"] == rows(site)["episodes"] == rows(site)["visits"] == 0
    assert visitor.get("/s/small/now").url.path == "/s/small"
    assert site.database.read_now(participants.get, before) is None


def test_withdrawal_works_later_with_the_code(site: PageSite) -> None:
    visitor = Visitor(site)
    walk_to(visitor, site, "thanks")
    code = site.only("small").completion_code or ""
    unknown_visitor = Visitor(site)
    unknown_visitor.get("/s/small/withdraw")
    wrong = unknown_visitor.send("/s/small/withdraw", unknown_visitor.fields("/withdraw") | {"code": "KM-2222-2222"})
    assert (wrong.status_code, len(site.everybody("small"))) == (422, 1)
    unknown_visitor.send("/s/small/withdraw", unknown_visitor.fields("/withdraw") | {"code": f" {code.lower()} "})
    assert site.everybody("small") == []


def test_place_of_somebody_who_was_away_too_long_is_given_to_another(site: PageSite) -> None:
    gone = Visitor(site)
    gone.consent("small")
    site.database.write_now(
        lambda connection: connection.execute(
            sql("update participants set last_seen_at = '2020-01-01 00:00:00.000000'")
        )
    )
    Visitor(site).consent("small")
    first, second = site.everybody("small")
    assert (first.status, second.status) == ("timed_out", "active")
    assert "This visit has ended" in gone.get("/s/small/now").text


def test_full_study_accepts_no_participant(tmp_path: Path) -> None:
    full = SMALL_STUDY.replace("predictor: none}", "predictor: none, quota: 1}").replace(
        "predictor: tom}", "predictor: tom, quota: 1}"
    )
    with PageSite(tmp_path, full) as site:
        statuses = [Visitor(site).consent("small").status_code for _ in range(3)]
        assert statuses == [200, 200, 409]
        assert len(site.everybody("small")) == 2
