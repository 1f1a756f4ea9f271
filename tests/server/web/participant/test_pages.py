"""A participant's pages over real HTTP: progress, what is stored and when, what is refused."""

import json
import re
from pathlib import Path

import pytest
from sqlalchemy import select

from server.store import answers, episodes, participants
from server.store.tables import metadata
from tests.support.page_site import EVERYTHING, SMALL_STUDY, PageSite, Visitor
from tests.support.small_site import LINK, pass_step, walk_to


def test_from_consent_to_the_completion_code(site: PageSite) -> None:
    visitor = Visitor(site)
    walk_to(visitor, site, "thanks")
    participant = site.only("small")
    assert participant.status == "completed"
    assert re.fullmatch(r"KM-[2-9A-Z]{4}-[2-9A-Z]{4}", participant.completion_code or "")
    assert participant.completion_code in visitor.get("/s/small/now").text
    stored = site.database.read_now(answers.of_participant, participant.id)
    assert stored["everything"] == {
        "mood": 4, "check": 2, "pick": "tea", "many": ["a", "c"], "words": "=1+1", "years": 30, "rank": ["y", "z", "x"],
    }  # fmt: skip
    assert [key for key in stored if key.startswith("after")] == ["after-01", "after-02", "after-03", "after-04"]
    assert len(site.database.read_now(episodes.of_participant, participant.id)) == 5


def test_answers_after_an_episode_belong_to_that_episode(site: PageSite) -> None:
    visitor = Visitor(site)
    walk_to(visitor, site, "ready-02")
    played = site.database.read_now(episodes.of_step, site.only("small").id, "episode-01")
    linked = site.database.read_now(
        lambda connection: set(
            connection.execute(
                select(metadata.tables["answers"].c.episode_id).where(
                    metadata.tables["answers"].c.step_key == "after-01"
                )
            ).scalars()
        )
    )
    assert played is not None
    assert linked == {played.id}


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"mood": "8"}, "Please choose a number from 1 to 7."),
        ({"mood": []}, "Please choose a number from 1 to 7."),
        ({"pick": "coffee"}, "Please choose one of the answers."),
        ({"many": ["a", "b", "c"]}, "Please choose between 1 and 2 of the answers."),
        ({"years": "17"}, "Please enter a number from 18 to 99."),
        ({"words": "x" * 21}, "Please write at most 20 characters; your answer has 21."),
        ({"rank__x": "1"}, "Please use each place from 1 to 3 exactly once."),
    ],
)
def test_wrong_answer_is_refused_at_its_field_and_nothing_else_is_lost(
    site: PageSite, change: dict[str, str | list[str]], words: str
) -> None:
    visitor = Visitor(site)
    visitor.consent("small")
    answer = visitor.submit("small", **(EVERYTHING | change))
    (key,) = change
    field = re.search(rf'<fieldset class="q missing" id="q-{key.partition("__")[0]}".*?</fieldset>', answer.text, re.S)
    assert answer.status_code == 422
    assert field is not None
    assert words in field.group()
    assert answer.text.count('class="q missing"') == 1
    kept = {
        "pick": 'value="tea"[^>]* checked',
        "check": 'value="2"[^>]* checked',
        "words": ">\n=1\\+1<",  # HTML drops the line break after the tag
        "years": 'value="30"',
    }
    for name, pattern in kept.items():
        assert name in change or re.search(pattern, answer.text), name
    assert site.step(site.only("small")).key == "everything"
    assert site.database.read_now(answers.of_participant, site.only("small").id) == {}


def test_submitted_text_is_shown_as_text(site: PageSite) -> None:
    visitor = Visitor(site)
    visitor.consent("small")
    answer = visitor.submit("small", **(EVERYTHING | {"words": '"><b>x</b>', "mood": "9"}))
    assert "<b>x</b>" not in answer.text
    assert "&lt;b&gt;x" in answer.text


def test_page_sent_twice_or_late_changes_nothing_and_leads_to_the_current_one(site: PageSite) -> None:
    visitor = Visitor(site)
    visitor.consent("small")
    stale = visitor.fields() | {key: value for key, value in EVERYTHING.items() if isinstance(value, str)}
    visitor.submit("small", **EVERYTHING)
    before = site.only("small").position
    answer = visitor.send("/s/small/now", stale)
    assert answer.url.path == "/s/small/now"
    assert site.only("small").position == before == 1
    assert site.database.read_now(answers.of_participant, site.only("small").id)["everything"]["mood"] == 4


def test_nobody_skips_a_game_or_an_unknown_step(site: PageSite) -> None:
    visitor = Visitor(site)
    walk_to(visitor, site, "tutorial")
    token = Visitor(site)
    token.client.cookies = visitor.client.cookies
    token.get("/s/small/withdraw")
    form_token = token.fields("/withdraw")
    for step in ("tutorial", "episode-01", "thanks", "", "everything"):
        visitor.send("/s/small/now", form_token | {"step": step})
        assert site.step(site.only("small")).key == "tutorial"


def test_tutorial_that_was_not_passed_is_repeated(site: PageSite) -> None:
    visitor = Visitor(site)
    walk_to(visitor, site, "tutorial")
    site.end_game(site.only("small"), passed=False)
    visitor.get("/s/small/now")
    assert site.step(site.only("small")).key == "tutorial"
    site.end_game(site.only("small"))
    visitor.get("/s/small/now")
    assert site.step(site.only("small")).key == "ready-01"


def test_episode_that_was_broken_off_is_left_behind(site: PageSite) -> None:
    visitor = Visitor(site)
    walk_to(visitor, site, "episode-01")
    visitor.get("/s/small/now")
    assert site.step(site.only("small")).key == "episode-01"
    site.end_game(site.only("small"), passed=False, status="aborted")
    visitor.get("/s/small/now")
    assert site.step(site.only("small")).key == "after-01"


def test_reload_at_every_step_comes_back_to_it(site: PageSite) -> None:
    visitor = Visitor(site)
    visitor.consent("small")
    seen = []
    while (step := site.step(site.only("small"))).kind != "thanks":
        for path in ("/s/small/now", "/s/small", "/s/small/now"):
            assert visitor.get(path).url.path == "/s/small/now"
            assert visitor.page.status_code == 200
        assert site.step(site.only("small")) == step
        seen.append(step.key)
        pass_step(visitor, site, step.kind)
    assert len(seen) == len(set(seen)) == 18


def test_recruited_person_is_one_row_on_every_device(site: PageSite) -> None:
    first, second = Visitor(site), Visitor(site)
    first.consent("hired", LINK)
    first.submit("hired", **EVERYTHING)
    page = second.get(f"/s/hired{LINK}")
    assert "Welcome back" in page.text
    second.consent("hired", LINK)
    assert site.step(site.only("hired")).key == "introduction"
    assert "Step 1 of" in second.page.text
    assert first.get("/s/hired/now").url.path == "/s/hired"  # the newest device plays


def test_next_person_on_the_same_computer_is_somebody_else(site: PageSite) -> None:
    visitor = Visitor(site)
    visitor.consent("hired", LINK)
    page = visitor.get("/s/hired?PROLIFIC_PID=5f1e00000000000000000002")
    assert page.url.path == "/s/hired"
    assert "I agree" in page.text
    visitor.consent("hired", "?PROLIFIC_PID=5f1e00000000000000000002")
    assert len(site.everybody("hired")) == 2


def test_parameters_of_the_link_are_stored_separately_and_the_return_link_is_filled_in(site: PageSite) -> None:
    visitor = Visitor(site)
    visitor.consent("hired", LINK)
    assert "PROLIFIC" not in str(visitor.page.url)
    participant = site.only("hired")
    assert site.database.read_now(participants.personal_of, participant.id) == {
        "recruitment_id": "5f1e00000000000000000001", "STUDY_ID": "s1", "SESSION_ID": "x9",
    }  # fmt: skip
    while (step := site.step(site.only("hired"))).kind != "thanks":
        pass_step(visitor, site, step.kind, "hired")
    page = visitor.get("/s/hired/now").text
    assert ">C1ABC</output>" in page
    assert 'href="https://app.prolific.com/submissions/complete?cc=C1ABC"' in page
    assert site.only("hired").completion_code in page


def test_link_without_the_person_is_refused_where_one_is_needed(site: PageSite) -> None:
    page = Visitor(site).get("/s/hired")
    assert page.status_code == 400
    assert "sign-up site" in page.text


def test_marks_are_explained_and_asked_about_only_where_some_are_shown(site: PageSite) -> None:
    for _ in range(2):
        visitor = Visitor(site)
        visitor.consent("small")
        mine = max(site.everybody("small"), key=lambda one: one.number)
        visitor.submit("small", **EVERYTHING)
        shows = mine.condition == "with"
        assert ('data-slide="marks"' in visitor.page.text) == shows
        site.database.write_now(participants.advance, mine.id, 1, 6)
        page = visitor.get("/s/small/now").text
        assert 'name="partner"' in page
        assert ('name="marks"' in page) == shows
    assert {one.condition for one in site.everybody("small")} == {"with", "without"}


def test_pages_never_name_the_condition(site: PageSite) -> None:
    visitor = Visitor(site)
    visitor.consent("small")
    while (step := site.step(site.only("small"))).kind != "thanks":
        page = visitor.get("/s/small/now").text
        assert "condition" not in page
        assert ">with<" not in page
        assert "without" not in page
        pass_step(visitor, site, step.kind)


def test_language_is_the_browsers_the_links_or_the_chosen_one(site: PageSite) -> None:
    assert '<html lang="zh"' in Visitor(site, {"accept-language": "zh-CN,zh;q=0.9"}).get("/").text
    visitor = Visitor(site)
    assert '<html lang="zh"' in visitor.get("/s/small?lang=zh").text
    visitor.consent("small", "?lang=zh")
    assert '<html lang="zh"' in visitor.page.text
    visitor.send("/s/small/language", visitor.fields("/language") | {"language": "en"})
    assert '<html lang="en"' in visitor.page.text
    assert site.only("small").language == "en"


def test_participant_keeps_the_version_they_consented_to(tmp_path: Path) -> None:
    with PageSite(tmp_path, SMALL_STUDY) as site:
        visitor = Visitor(site)
        visitor.consent("small")
        cookies = visitor.client.cookies
    changed = SMALL_STUDY.replace("title: {en: Everything,", "title: {en: Everything new,")
    with PageSite(tmp_path, changed) as site:
        old, new = Visitor(site), Visitor(site)
        for cookie in cookies.jar:
            old.client.cookies.set(cookie.name, cookie.value or "", domain=cookie.domain, path=cookie.path)
        assert "<h1>Everything</h1>" in old.get("/s/small/now").text
        assert "<h1>Everything new</h1>" in new.consent("small").text


def test_a_round_shows_the_points_of_the_rounds_before(site: PageSite) -> None:
    visitor = Visitor(site)
    walk_to(visitor, site, "episode-02")
    config = re.search(
        r'<script type="application/json" id="game-config">(.*?)</script>', visitor.get("/s/small/now").text, re.S
    )
    assert config
    assert json.loads(config[1])["rounds"] == [{"number": 1, "score": 60}]


@pytest.mark.parametrize(("status", "said"), [("done", "After round 1 of"), ("aborted", "was stopped early")])
def test_who_was_away_when_a_round_ended_reads_that_it_was_stopped(site: PageSite, status: str, said: str) -> None:
    visitor = Visitor(site)
    walk_to(visitor, site, "episode-01")
    site.end_game(site.only("small"), passed=status == "done", status=status)
    assert said in visitor.get("/s/small/now").text
