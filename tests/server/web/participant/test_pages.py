"""A participant's pages over real HTTP: who gets where, what is stored and when, what is refused."""

import json
import re
from collections.abc import Iterator
from pathlib import Path

import pytest
from sqlalchemy import select
from sqlalchemy import text as sql

from server.store import answers, episodes, events, participants
from server.store.tables import metadata
from tests.support.page_site import EVERYTHING, SMALL_STUDY, Site, Visitor

PROLIFIC = SMALL_STUDY.replace("name: small", "name: hired", 1).replace(
    "seed: 11\n",
    "seed: 11\nrecruitment:\n  source: prolific\n  required: true\n"
    '  completed: {code: C1ABC, url: "https://app.prolific.com/submissions/complete?cc={code}"}\n'
    '  screened_out: {code: C2DEF, url: "https://app.prolific.com/submissions/complete?cc={code}"}\n',
)
LINK = "?PROLIFIC_PID=5f1e00000000000000000001&STUDY_ID=s1&SESSION_ID=x9"


@pytest.fixture
def site(tmp_path: Path) -> Iterator[Site]:
    with Site(tmp_path, SMALL_STUDY, PROLIFIC) as running:
        yield running


def rows(site: Site) -> dict[str, int]:
    def count(connection):  # type: ignore[no-untyped-def]
        return {
            table.name: connection.execute(sql(f"select count(*) from {table.name}")).scalar()
            for table in metadata.sorted_tables
        }

    return site.database.read_now(count)


def walk_to(visitor: Visitor, site: Site, key: str, name: str = "small") -> None:
    """From consent to the step with this key, playing the games by hand."""
    visitor.consent(name)
    while (step := site.step(site.only(name))).key != key:
        pass_step(visitor, site, step.kind, name)


def pass_step(visitor: Visitor, site: Site, kind: str, name: str = "small") -> None:
    participant = site.only(name)
    if kind in ("tutorial", "episode"):
        site.end_game(participant)
        visitor.get(f"/s/{name}/now")
        return
    step = site.step(participant)
    given = {"quiz": {"onions": "three"}, "everything": EVERYTHING, "after": {"partner": "5", "marks": "6"}}
    visitor.submit(name, **given.get(step.page or step.kind, {}))


def test_start_page_offers_the_studies(site: Site) -> None:
    page = Visitor(site).get("/")
    assert page.status_code == 200
    assert 'href="/s/small?lang=en"' in page.text


@pytest.mark.parametrize(("minutes", "said"), [(1, "About 1 minute<"), (2, "About 2 minutes<")])
def test_start_page_counts_minutes_as_people_do(tmp_path: Path, minutes: int, said: str) -> None:
    with Site(tmp_path, re.sub(r"duration_min: \d+", f"duration_min: {minutes}", SMALL_STUDY)) as site:
        assert said in Visitor(site).get("/").text


def test_nothing_is_stored_and_no_cookie_is_set_before_consent(site: Site) -> None:
    before = rows(site)
    visitor = Visitor(site)
    for path in ("/", "/s/small", "/s/small/now", "/s/small/unsuitable", "/s/small/declined", "/s/small/withdraw"):
        assert visitor.get(path).status_code == 200
    for _ in range(5):
        visitor.get(f"/s/hired{LINK}")
    assert rows(site) == before
    assert not visitor.client.cookies


def test_consent_makes_one_participant_with_a_guarded_cookie(site: Site) -> None:
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


def test_consent_page_sent_twice_makes_one_participant(site: Site) -> None:
    visitor = Visitor(site)
    visitor.get("/s/small")
    fields = visitor.fields("/consent") | {"box_0": "yes"}
    for _ in range(3):
        again = Visitor(site)
        assert again.send("/s/small/consent", fields).url.path == "/s/small/now"
    assert len(site.everybody("small")) == 1


def test_consent_page_sent_again_after_its_answer_was_lost_leads_on(site: Site) -> None:
    """The answer brought the cookie, then the line broke: the page in the browser is older than the cookie."""
    visitor = Visitor(site)
    visitor.get("/s/small")
    fields = visitor.fields("/consent") | {"box_0": "yes"}
    assert visitor.send("/s/small/consent", fields).url.path == "/s/small/now"
    assert visitor.client.cookies
    assert visitor.send("/s/small/consent", fields).url.path == "/s/small/now"
    assert len(site.everybody("small")) == 1
    another = Visitor(site)
    another.get("/s/small")
    assert visitor.client.post("/s/small/consent", data=another.fields("/consent")).status_code == 403


def test_consent_without_every_box_is_refused_and_stores_nothing(site: Site) -> None:
    visitor = Visitor(site)
    visitor.get("/s/small")
    answer = visitor.send("/s/small/consent", visitor.fields("/consent"))
    assert answer.status_code == 422
    assert "Please tick every box" in answer.text
    assert site.everybody("small") == []


def test_whole_way_from_consent_to_the_code(site: Site) -> None:
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


def test_answers_after_an_episode_belong_to_that_episode(site: Site) -> None:
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
        ({"words": "x" * 21}, "Please write at most 20 characters; these are 21."),
        ({"rank__x": "1"}, "Please give every place from 1 to 3 once."),
    ],
)
def test_wrong_answer_is_refused_at_its_field_and_nothing_else_is_lost(
    site: Site, change: dict[str, str | list[str]], words: str
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


def test_submitted_text_is_shown_as_text(site: Site) -> None:
    visitor = Visitor(site)
    visitor.consent("small")
    answer = visitor.submit("small", **(EVERYTHING | {"words": '"><b>x</b>', "mood": "9"}))
    assert "<b>x</b>" not in answer.text
    assert "&lt;b&gt;x" in answer.text


def test_page_sent_twice_or_late_changes_nothing_and_leads_to_the_current_one(site: Site) -> None:
    visitor = Visitor(site)
    visitor.consent("small")
    stale = visitor.fields() | {key: value for key, value in EVERYTHING.items() if isinstance(value, str)}
    visitor.submit("small", **EVERYTHING)
    before = site.only("small").position
    answer = visitor.send("/s/small/now", stale)
    assert answer.url.path == "/s/small/now"
    assert site.only("small").position == before == 1
    assert site.database.read_now(answers.of_participant, site.only("small").id)["everything"]["mood"] == 4


def test_nobody_skips_a_game_or_an_unknown_step(site: Site) -> None:
    visitor = Visitor(site)
    walk_to(visitor, site, "tutorial")
    token = Visitor(site)
    token.client.cookies = visitor.client.cookies
    token.get("/s/small/withdraw")
    form_token = token.fields("/withdraw")
    for step in ("tutorial", "episode-01", "thanks", "", "everything"):
        visitor.send("/s/small/now", form_token | {"step": step})
        assert site.step(site.only("small")).key == "tutorial"


def test_tutorial_that_was_not_passed_is_repeated(site: Site) -> None:
    visitor = Visitor(site)
    walk_to(visitor, site, "tutorial")
    site.end_game(site.only("small"), passed=False)
    visitor.get("/s/small/now")
    assert site.step(site.only("small")).key == "tutorial"
    site.end_game(site.only("small"))
    visitor.get("/s/small/now")
    assert site.step(site.only("small")).key == "ready-01"


def test_episode_that_was_broken_off_is_left_behind(site: Site) -> None:
    visitor = Visitor(site)
    walk_to(visitor, site, "episode-01")
    visitor.get("/s/small/now")
    assert site.step(site.only("small")).key == "episode-01"
    site.end_game(site.only("small"), passed=False, status="aborted")
    visitor.get("/s/small/now")
    assert site.step(site.only("small")).key == "after-01"


def test_reload_at_every_step_comes_back_to_it(site: Site) -> None:
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


def test_finished_person_cannot_start_over(site: Site) -> None:
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


def test_recruited_person_is_one_row_on_every_device(site: Site) -> None:
    first, second = Visitor(site), Visitor(site)
    first.consent("hired", LINK)
    first.submit("hired", **EVERYTHING)
    page = second.get(f"/s/hired{LINK}")
    assert "Welcome back" in page.text
    second.consent("hired", LINK)
    assert site.step(site.only("hired")).key == "introduction"
    assert "Step 1 of" in second.page.text
    assert first.get("/s/hired/now").url.path == "/s/hired"  # the newest device plays


def test_next_person_on_the_same_computer_is_somebody_else(site: Site) -> None:
    visitor = Visitor(site)
    visitor.consent("hired", LINK)
    page = visitor.get("/s/hired?PROLIFIC_PID=5f1e00000000000000000002")
    assert page.url.path == "/s/hired"
    assert "I agree" in page.text
    visitor.consent("hired", "?PROLIFIC_PID=5f1e00000000000000000002")
    assert len(site.everybody("hired")) == 2


def test_parameters_of_the_link_are_kept_apart_and_the_way_back_is_filled_in(site: Site) -> None:
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


def test_link_without_the_person_is_refused_where_one_is_needed(site: Site) -> None:
    page = Visitor(site).get("/s/hired")
    assert page.status_code == 400
    assert "sign-up site" in page.text


def test_unsuitable_device_gets_the_screened_out_code(site: Site) -> None:
    page = Visitor(site).get("/s/hired/unsuitable").text
    assert ">C2DEF</output>" in page
    assert "complete?cc=C2DEF" in page
    assert "Your return code" in page
    assert "completion code" not in page, "the person completed nothing"


def test_quiz_is_repeated_until_right_and_failures_are_noted(site: Site) -> None:
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


def test_a_quiz_with_one_attempt_says_so_as_people_do(tmp_path: Path) -> None:
    with Site(tmp_path, re.sub(r"attempts: \d+", "attempts: 1", SMALL_STUDY)) as site:
        visitor = Visitor(site)
        walk_to(visitor, site, "quiz")
        assert "You have one try." in visitor.get("/s/small/now").text


def test_quiz_failed_too_often_ends_the_study_and_frees_the_place(site: Site) -> None:
    visitor = Visitor(site)
    walk_to(visitor, site, "quiz")
    for _ in range(3):
        visitor.get("/s/small/now")
        visitor.submit("small", onions="two")
    assert site.only("small").status == "screened_out"
    assert "The study ends here" in visitor.get("/s/small/now").text


def test_failed_attention_check_is_taken_and_noted(site: Site) -> None:
    visitor = Visitor(site)
    visitor.consent("small")
    visitor.submit("small", **(EVERYTHING | {"check": "7"}))
    assert site.step(site.only("small")).key == "introduction"
    noted = site.database.read_now(events.of_participant, site.only("small").id, "attention_failed")
    assert [event.detail for event in noted] == [{"step": "everything", "questions": ["check"]}]


def test_marks_are_explained_and_asked_about_only_where_some_are_shown(site: Site) -> None:
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


def test_pages_never_name_the_condition(site: Site) -> None:
    visitor = Visitor(site)
    visitor.consent("small")
    while (step := site.step(site.only("small"))).kind != "thanks":
        page = visitor.get("/s/small/now").text
        assert "condition" not in page
        assert ">with<" not in page
        assert "without" not in page
        pass_step(visitor, site, step.kind)


def test_language_is_the_browsers_the_links_or_the_chosen_one(site: Site) -> None:
    assert '<html lang="zh"' in Visitor(site, {"accept-language": "zh-CN,zh;q=0.9"}).get("/").text
    visitor = Visitor(site)
    assert '<html lang="zh"' in visitor.get("/s/small?lang=zh").text
    visitor.consent("small", "?lang=zh")
    assert '<html lang="zh"' in visitor.page.text
    visitor.send("/s/small/language", visitor.fields("/language") | {"language": "en"})
    assert '<html lang="en"' in visitor.page.text
    assert site.only("small").language == "en"


def test_withdrawal_deletes_the_participant_and_leaves_a_count(site: Site) -> None:
    visitor = Visitor(site)
    walk_to(visitor, site, "ready-02")
    before = site.only("small").id
    visitor.get("/s/small/withdraw")
    page = visitor.send("/s/small/withdraw", visitor.fields("/withdraw"))
    assert "Your data have been deleted" in page.text
    assert site.everybody("small") == []
    assert rows(site)["withdrawals"] == 1
    assert rows(site)["answers"] == rows(site)["episodes"] == rows(site)["visits"] == 0
    assert visitor.get("/s/small/now").url.path == "/s/small"
    assert site.database.read_now(participants.get, before) is None


def test_withdrawal_works_later_with_the_code(site: Site) -> None:
    visitor = Visitor(site)
    walk_to(visitor, site, "thanks")
    code = site.only("small").completion_code or ""
    unknown_visitor = Visitor(site)
    unknown_visitor.get("/s/small/withdraw")
    wrong = unknown_visitor.send("/s/small/withdraw", unknown_visitor.fields("/withdraw") | {"code": "KM-2222-2222"})
    assert (wrong.status_code, len(site.everybody("small"))) == (422, 1)
    unknown_visitor.send("/s/small/withdraw", unknown_visitor.fields("/withdraw") | {"code": f" {code.lower()} "})
    assert site.everybody("small") == []


def test_place_of_somebody_who_was_away_too_long_is_given_to_another(site: Site) -> None:
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


def test_full_study_takes_nobody(tmp_path: Path) -> None:
    full = SMALL_STUDY.replace("predictor: none}", "predictor: none, quota: 1}").replace(
        "predictor: tom}", "predictor: tom, quota: 1}"
    )
    with Site(tmp_path, full) as site:
        statuses = [Visitor(site).consent("small").status_code for _ in range(3)]
        assert statuses == [200, 200, 409]
        assert len(site.everybody("small")) == 2


def test_participant_keeps_the_version_they_consented_to(tmp_path: Path) -> None:
    with Site(tmp_path, SMALL_STUDY) as site:
        visitor = Visitor(site)
        visitor.consent("small")
        cookies = visitor.client.cookies
    changed = SMALL_STUDY.replace("title: {en: Everything,", "title: {en: Everything new,")
    with Site(tmp_path, changed) as site:
        old, new = Visitor(site), Visitor(site)
        for cookie in cookies.jar:
            old.client.cookies.set(cookie.name, cookie.value or "", domain=cookie.domain, path=cookie.path)
        assert "<h1>Everything</h1>" in old.get("/s/small/now").text
        assert "<h1>Everything new</h1>" in new.consent("small").text


def test_a_round_knows_the_points_of_the_rounds_before(site: Site) -> None:
    visitor = Visitor(site)
    walk_to(visitor, site, "episode-02")
    config = re.search(
        r'<script type="application/json" id="game-config">(.*?)</script>', visitor.get("/s/small/now").text, re.S
    )
    assert config
    assert json.loads(config[1])["rounds"] == [{"number": 1, "score": 60}]
