"""Attention checks: accepted and flagged, counted in export and dashboard, and ending the study if it says so."""

import asyncio
from collections.abc import Iterator
from pathlib import Path

import polars as pl
import pytest

from analysis import data_quality, measures
from analysis.tables import read_export
from kitchenmind.client.pages import ParsedPage
from server.bots.participant import Bot
from server.export.writer import export
from server.monitoring.enrolment_flow import arms_of, flow_of, stock
from server.store import answers, events, overview, participants
from server.study.loader import StudyError, parse_study
from tests.support.page_site import EVERYTHING, SMALL_STUDY, PageSite, Visitor

AFTER = "      - {key: marks, type: scale, conditions: with_predictor"
CHECKED_AFTER = (
    f"      - {{key: awake, type: scale, attention: 1, text: {{en: Choose 1, zh: 选一}}, low: 1, high: 7}}\n{AFTER}"
)
FREE = SMALL_STUDY.replace(AFTER, CHECKED_AFTER)
STRICT = FREE.replace("name: small", "name: strict", 1).replace(
    "after_episode: after\n",
    "after_episode: after\nattention: {screen_out_after: 2}\nrecruitment: {screened_out: {code: KM-OUT}}\n",
)
WRONG = EVERYTHING | {"check": "7"}


@pytest.fixture(scope="module")
def site(tmp_path_factory: pytest.TempPathFactory) -> Iterator[PageSite]:
    with PageSite(tmp_path_factory.mktemp("attention"), FREE, STRICT) as running:
        yield running


def after_the_first_episode(site: PageSite, name: str, awake: str, everything: dict[str, str | list[str]]) -> Visitor:
    """Somebody who has answered the first page so, and `awake` after the first episode."""
    visitor = Visitor(site)
    visitor.consent(name)
    visitor.submit(name, **everything)
    me = site.everybody(name)[-1]
    keys = [step.key for step in site.studies.steps_of(me)]
    site.database.write_now(participants.advance, me.id, 1, keys.index("episode-01"))
    site.end_game(me)
    visitor.get(f"/s/{name}/now")
    marks = {"marks": "4"} if me.condition == "with" else {}
    visitor.submit(name, partner="4", awake=awake, **marks)
    return visitor


def test_every_check_is_stored_as_passed_or_failed(site: PageSite) -> None:
    after_the_first_episode(site, "small", "1", WRONG)
    me = site.everybody("small")[-1]
    assert site.step(me).key == "ready-02", "nobody is screened out unless the study says so"
    assert site.database.read_now(answers.attention_of, me.id) == answers.AttentionCount(answered=2, failed=1)


def test_failing_as_many_checks_as_the_study_allows_screens_out(site: PageSite) -> None:
    once = after_the_first_episode(site, "strict", "1", WRONG)
    assert site.step(site.everybody("strict")[-1]).key == "ready-02"
    assert "Round 2" in once.get("/s/strict/now").text
    twice = after_the_first_episode(site, "strict", "7", WRONG)
    me = site.everybody("strict")[-1]
    assert me.status == "screened_out"
    page = twice.get("/s/strict/now").text
    assert "Some questions asked you to choose a certain answer" in page
    assert "KM-OUT" in page
    bot = Bot("http://127.0.0.1", "strict", 1)
    journal = asyncio.run(bot.continue_from(ParsedPage(page)))
    assert (bot.dropped, journal.code, journal.violations) == (True, None, []), "no fault of the server, no completion"
    said = site.database.read_now(answers.of_participant, me.id)
    assert said["after-01"]["awake"] == 7, "the answers stay"
    (noted,) = site.database.read_now(events.of_participant, me.id, events.ATTENTION_SCREENED_OUT)
    assert noted.detail == {"failed": 2, "answered": 2}


def test_page_that_is_sent_again_changes_nothing(site: PageSite) -> None:
    visitor = Visitor(site)
    visitor.consent("strict")
    page = visitor.page
    for _ in range(3):
        visitor.page = page
        visitor.submit("strict", **WRONG)
    me = site.everybody("strict")[-1]
    assert me.status == "active"
    assert site.database.read_now(answers.attention_of, me.id).failed == 1


def test_flow_counts_people_screened_out_by_checks_and_people_who_failed_one(site: PageSite) -> None:
    found = site.studies.open("strict")
    assert found is not None
    study_id, study = found
    held = site.database.read_now(stock, overview.Group((study_id,)))
    before = flow_of(study, held)
    visitor = after_the_first_episode(site, "strict", "7", WRONG)
    stays = after_the_first_episode(site, "strict", "1", WRONG)
    me = site.everybody("strict")[-1]
    site.database.write_now(participants.complete, me.id, "KM-2222-2222")
    held = site.database.read_now(stock, overview.Group((study_id,)))
    after = flow_of(study, held)

    def lost(nodes: list[dict[str, object]], word: str) -> int:
        return sum(node["lost"].get(word, 0) for node in nodes)  # type: ignore[attr-defined]

    assert lost(after, "failed attention checks") == lost(before, "failed attention checks") + 1
    assert lost(after, "screened out") == 0, "nobody failed the quiz"
    assert next(node for node in after if node["name"] == "Completed")["flags"] == {"failed an attention check": 1}
    arms = arms_of(study, held, {"with": "with", "without": "without"}, blind=False)
    assert sum(arm["lost"].get("failed attention checks", 0) for arm in arms) == lost(after, "failed attention checks")
    assert (visitor.page.status_code, stays.page.status_code) == (200, 200)


def test_export_has_the_checks_and_the_analysis_leaves_them_out_of_its_measures(site: PageSite, tmp_path: Path) -> None:
    after_the_first_episode(site, "small", "7", WRONG)
    me = site.everybody("small")[-1]
    site.database.read_now(export, tmp_path / "data", ("csv", "parquet"), "small")
    said = pl.read_csv(next((tmp_path / "data").rglob("*answers*.csv"))).filter(pl.col("participant") == me.id)
    flagged = dict(said.select("question", "attention").iter_rows())
    assert (flagged["check"], flagged["awake"], flagged["partner"]) == (False, False, None)
    people = pl.read_parquet(tmp_path / "data" / "parquet" / "participants.parquet")
    counted = people.filter(pl.col("participant") == me.id).select("attention_checks", "attention_failed").row(0)
    assert counted == (2, 2)
    read = read_export(tmp_path / "data")
    assert "awake" not in read.answers["question"].to_list()
    proposed = data_quality.proposals(measures.episode_measures(read), read.answers).filter(
        pl.col("participant") == me.id
    )
    assert proposed["proposal"].to_list() == ["drop"]
    assert "inattentive" in str(proposed["rules"][0])


def test_study_that_screens_out_after_more_checks_than_it_asks_is_refused() -> None:
    text = SMALL_STUDY + "attention: {screen_out_after: 2}\n"
    with pytest.raises(StudyError, match="nobody can fail 2 attention checks: the study asks 1"):
        parse_study(text)
    parse_study(FREE + "attention: {screen_out_after: 5}\n")
