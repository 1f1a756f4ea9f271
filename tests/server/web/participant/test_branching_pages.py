"""Pages and questions that depend on earlier answers: who gets them, what is stored, and what the export contains."""

import json
from collections.abc import Iterator
from pathlib import Path

import pytest

import kitchenmind
from server.export.writer import export
from server.store import answers, events, participants
from tests.support.page_site import EVERYTHING, PageSite, Visitor
from tests.support.study_text import BRANCHED


@pytest.fixture(scope="module")
def site(tmp_path_factory: pytest.TempPathFactory) -> Iterator[PageSite]:
    with PageSite(tmp_path_factory.mktemp("site"), BRANCHED) as running:
        yield running


def arrived(site: PageSite, **said: str) -> tuple[Visitor, str]:
    """Somebody who has sent the first page with these answers."""
    visitor = Visitor(site)
    visitor.consent("small")
    visitor.submit("small", **{**EVERYTHING, **said})
    return visitor, site.everybody("small")[-1].id


def events_of(site: PageSite, person: str) -> list[dict[str, object]]:
    found = site.database.read_now(events.of_participant, person, "not_asked")
    return [dict(one.detail) for one in found]


def at(site: PageSite, person: str) -> str:
    participant = site.database.read_now(participants.get, person)
    assert participant is not None
    return site.step(participant).key


def test_a_page_comes_only_after_its_answer_and_a_question_on_it_too(site: PageSite) -> None:
    visitor, person = arrived(site, mood="7", pick="tea")
    assert at(site, person) == "more"
    assert ('name="sweet"' in visitor.page.text, 'name="sugar"' in visitor.page.text) == (True, False)
    reloaded = visitor.get("/s/small/now")
    assert 'name="sugar"' not in reloaded.text
    visitor.submit("small", sweet="yes", sugar="much")  # the field that was not there is not read
    assert at(site, person) == "introduction"
    assert site.database.read_now(answers.of_participant, person)["more"] == {"sweet": "yes"}
    assert events_of(site, person) == [{"step": "more", "questions": ["sugar"]}]


def test_a_page_without_its_answer_is_passed_over_also_with_back_and_reload(site: PageSite) -> None:
    visitor, person = arrived(site, mood="3", pick="milk")
    assert at(site, person) == "introduction"
    assert events_of(site, person) == [{"step": "more", "questions": ["sweet", "sugar"]}]
    old = visitor.fields() | {"step": "more", "sweet": "yes"}
    visitor.send("/s/small/now", old)
    assert at(site, person) == "introduction", "a page that is not theirs changes nothing"
    assert "more" not in site.database.read_now(answers.of_participant, person)
    visitor.get("/s/small/now")
    assert len(events_of(site, person)) == 1, "coming back notes nothing twice"


def test_everybody_reaches_the_end_and_the_export_lists_what_was_not_asked(site: PageSite, tmp_path: Path) -> None:
    for pick, shown in (("milk", True), ("tea", False)):
        _, person = arrived(site, mood="7", pick=pick)
        me = site.database.read_now(participants.get, person)
        assert me is not None
        keys = [step.key for step in site.studies.steps_of(me)]
        last = keys.index("after-04")
        site.database.write_now(participants.advance, person, me.position, last)
        visitor = Visitor(site)
        visitor.client.cookies.update(site.clients[-2].cookies)
        visitor.get("/s/small/now")
        shows_marks = me.condition == "with"
        visitor.submit("small", partner="4", **({"marks": "4"} if shows_marks else {}))
        assert at(site, person) == ("goodbye" if shown else "thanks")
        if shown:
            visitor.submit("small")
        ended = site.database.read_now(participants.get, person)
        assert ended is not None
        assert (ended.status, ended.completion_code is not None) == ("completed", True)
    site.database.read_now(export, tmp_path / "data", ("parquet",), None)
    noted = kitchenmind.load(tmp_path / "data").events.filter(kind="not_asked")
    assert {"step": "goodbye", "questions": []} in [json.loads(detail) for detail in noted["detail"]]
