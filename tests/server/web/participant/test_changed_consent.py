"""A new version of a study is opened while somebody reads the consent page: nobody agrees to a text unread."""

import asyncio
from collections.abc import Iterator
from pathlib import Path

import pytest

from server.study.loader import parse_study
from tests.server.web.participant.test_recruiters import RECRUITMENTS
from tests.support.page_site import SMALL_STUDY, PageSite, Visitor

OLD, NEW = "You *cook*.", "Your games are recorded."
CHANGED = "This page was changed after you opened it"


@pytest.fixture
def site(tmp_path: Path) -> Iterator[PageSite]:
    with PageSite(tmp_path, SMALL_STUDY) as running:
        yield running


def open_version(site: PageSite, text: str) -> None:
    site.studies.let_into("small", asyncio.run(site.studies.add(site.database, parse_study(text))))


def agree(visitor: Visitor) -> int:
    return visitor.send("/s/small/consent", visitor.fields("/consent") | {"box_0": "yes"}).status_code


def test_a_participant_who_read_an_earlier_text_reads_the_new_one_before_agreeing(site: PageSite) -> None:
    visitor = Visitor(site)
    visitor.get("/s/small")
    open_version(site, SMALL_STUDY.replace(OLD, NEW, 1))
    assert agree(visitor) == 409
    assert site.everybody("small") == []
    assert CHANGED in visitor.page.text
    assert NEW in visitor.page.text
    assert "checked" not in visitor.page.text, "a box stands for the new text now"
    assert agree(visitor) == 200
    assert len(site.everybody("small")) == 1


def test_open_boxes_of_an_earlier_text_are_those_of_the_new_one(site: PageSite) -> None:
    visitor = Visitor(site)
    visitor.get("/s/small")
    another = "    - {en: I agree, zh: 我同意}\n"
    open_version(site, SMALL_STUDY.replace(another, another + another.replace("agree", "am 18"), 1))
    assert agree(visitor) == 409
    assert "I am 18" in visitor.page.text
    assert "checked" not in visitor.page.text


def test_a_version_that_is_opened_in_the_moment_of_consent_asks_again(
    site: PageSite, monkeypatch: pytest.MonkeyPatch
) -> None:
    visitor = Visitor(site)
    visitor.get("/s/small")
    number, study = site.studies.open("small")  # type: ignore[misc]
    changed = parse_study(SMALL_STUDY.replace(OLD, NEW, 1)).study
    found = iter([(number, study)])
    monkeypatch.setattr(site.studies, "open", lambda _: next(found, (number, changed)))
    assert agree(visitor) == 409
    assert NEW in visitor.page.text
    monkeypatch.undo()
    assert site.everybody("small") == []


def test_other_changes_of_a_study_ask_nobody_twice(site: PageSite) -> None:
    visitor = Visitor(site)
    visitor.get("/s/small")
    open_version(site, SMALL_STUDY.replace("horizon: 20", "horizon: 30", 1))
    assert agree(visitor) == 200
    assert len(site.everybody("small")) == 1


def test_somebody_who_takes_part_already_continues_with_the_earlier_text(tmp_path: Path) -> None:
    text = SMALL_STUDY.replace("seed: 11\n", f"seed: 11\nrecruitment: {RECRUITMENTS['prolific']}\n", 1)
    link = f"/s/small?PROLIFIC_PID={1:024x}&STUDY_ID=s1&SESSION_ID=x9"
    with PageSite(tmp_path, text) as site:
        assert Visitor(site).consent("small", link.removeprefix("/s/small")).status_code == 200
        again = Visitor(site)
        again.get(link)
        open_version(site, text.replace(OLD, NEW, 1))
        assert again.send("/s/small/consent", again.fields("/consent")).status_code == 200
