"""Every attempt at the quiz has a number: a page that is sent twice, late or at the same time counts once."""

from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import httpx
import pytest

from server.store import events, participants
from tests.support.page_site import SMALL_STUDY, PageSite, Visitor

TWICE = SMALL_STUDY.replace("attempts: 3", "attempts: 2")
WRONG, RIGHT = {"onions": "two"}, {"onions": "three"}


@pytest.fixture
def site(tmp_path: Path) -> Iterator[PageSite]:
    assert "attempts: 2" in TWICE
    with PageSite(tmp_path, TWICE) as running:
        yield running


@pytest.fixture
def visitor(site: PageSite) -> Visitor:
    """Somebody at the quiz."""
    made = Visitor(site)
    made.consent("small")
    me = site.only("small")
    way = site.studies.steps_of(me)
    site.database.write_now(participants.advance, me.id, 0, [step.key for step in way].index("quiz"))
    made.get("/s/small/now")
    return made


def failures(site: PageSite) -> list[int]:
    noted = site.database.read_now(events.of_participant, site.only("small").id, "quiz_failed")
    return [event.detail["attempt"] for event in noted]


def stands(site: PageSite) -> tuple[str, str]:
    me = site.only("small")
    return me.status, site.step(me).key


def test_the_same_wrong_page_sent_again_counts_once(site: PageSite, visitor: Visitor) -> None:
    fields = visitor.fields() | WRONG
    for _ in range(5):
        answer = visitor.send("/s/small/now", fields)
        assert (answer.status_code, "That is not right" in answer.text) == (422, True)
        assert visitor.fields()["attempt"] == "2"
    assert failures(site) == [1]
    assert stands(site) == ("active", "quiz")
    visitor.submit("small", **RIGHT)
    assert stands(site) == ("active", "tutorial")


def test_the_last_attempt_ends_the_study_also_when_it_is_sent_twice(site: PageSite, visitor: Visitor) -> None:
    visitor.submit("small", **WRONG)
    fields = visitor.fields() | WRONG
    for _ in range(2):
        assert "The study ends here" in visitor.send("/s/small/now", fields).text
    assert failures(site) == [1, 2]
    assert stands(site)[0] == "screened_out"


def test_a_finished_quiz_attempt_is_not_checked_again(site: PageSite, visitor: Visitor) -> None:
    """Otherwise the first attempt's number would allow endless guessing."""
    first = visitor.fields()
    visitor.submit("small", **WRONG)
    answer = visitor.send("/s/small/now", first | RIGHT)
    assert (answer.status_code, "That is not right" in answer.text) == (200, False)
    assert failures(site) == [1]
    assert stands(site) == ("active", "quiz")


@pytest.mark.parametrize("attempt", ["", "0", "3", "-1", "x", "9" * 40, "１"])
def test_a_number_that_no_attempt_has_changes_nothing(site: PageSite, visitor: Visitor, attempt: str) -> None:
    fields = visitor.fields() | {"attempt": attempt}
    for given in (WRONG, RIGHT):
        assert visitor.send("/s/small/now", fields | given).url.path == "/s/small/now"
    assert failures(site) == []
    assert stands(site) == ("active", "quiz")


def test_one_right_and_many_wrong_at_once_never_end_the_study(site: PageSite, visitor: Visitor) -> None:
    fields, headers = visitor.fields(), {"accept": "text/html"}
    cookies = dict(visitor.client.cookies)

    def send(given: dict[str, str]) -> int:
        with httpx.Client(base_url=site.url, cookies=cookies, headers=headers, timeout=60) as client:
            return client.post("/s/small/now", data=fields | given).status_code

    with ThreadPoolExecutor(8) as several:
        statuses = list(several.map(send, [WRONG, WRONG, WRONG, RIGHT, WRONG, WRONG, RIGHT, WRONG]))
    assert set(statuses) <= {303, 422}
    assert stands(site) in (("active", "quiz"), ("active", "tutorial"))
    assert failures(site) in ([], [1])


def test_somebody_who_passed_is_not_screened_out_by_a_late_wrong_page(site: PageSite, visitor: Visitor) -> None:
    fields = visitor.fields()
    visitor.submit("small", **RIGHT)
    for attempt in ("1", "2"):
        visitor.send("/s/small/now", fields | WRONG | {"attempt": attempt})
    assert failures(site) == []
    assert stands(site) == ("active", "tutorial")
