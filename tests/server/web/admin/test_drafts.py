"""Studies that are written in the dashboard: drafts, their checks, conflicts and history."""

import json
import threading
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from urllib.parse import urlencode

import pytest
from fastapi.routing import APIRoute
from websockets import InvalidStatus, Origin
from websockets.sync.client import connect

from server.store import study_drafts
from server.store.study_drafts import DraftText
from server.web.admin import draft_routes
from tests.support.draft_site import admin_site_fixture as admin_site_fixture
from tests.support.draft_site import asked, begun, source
from tests.support.draft_site import file as file
from tests.support.draft_site import site as site
from tests.support.page_site import PageSite, Visitor
from tests.support.researcher_site import signed_in


def test_drafts_are_for_owners_only(site: PageSite) -> None:
    draft = begun(site, signed_in(site, "own"))
    for role in ("watch", "act", None):
        visitor = signed_in(site, role) if role else Visitor(site)
        cookies = "; ".join(f"{name}={value}" for name, value in visitor.client.cookies.items())
        game = f"ws{site.url.removeprefix('http')}/admin/drafts/{draft}/preview/with/en/9/socket"
        with (
            pytest.raises(InvalidStatus),
            connect(game, origin=Origin(site.url), additional_headers={"Cookie": cookies}),
        ):
            pass
        for route in (route for part in draft_routes.PARTS for route in part.router.routes):
            if not isinstance(route, APIRoute):
                continue  # the game of a preview
            for method in route.methods:
                path = route.path.format(draft=draft, number=1, condition="x", language="en", position=0, what="now")
                answer = visitor.client.request(method, path, headers={"accept": "application/json"})
                assert answer.status_code in (401, 403), f"{role}: {method} {path} gives {answer.status_code}"
    assert "Drafts" not in signed_in(site, "act").get("/admin").text


def test_a_form_from_elsewhere_changes_no_draft(site: PageSite) -> None:
    researcher = signed_in(site, "own")
    draft = begun(site, researcher)
    before = source(site, draft)
    for token in ("", "made up"):
        body = urlencode({"form_token": token, "text": "gone", "revision": "2"})
        headers = {"content-type": "application/x-www-form-urlencoded"}
        answer = researcher.client.post(f"/admin/drafts/{draft}/save", content=body, headers=headers)
        assert answer.status_code == 403
    assert source(site, draft) == before


def test_a_new_study_begins_from_a_template_with_its_own_name_title_and_seed(site: PageSite) -> None:
    researcher = signed_in(site, "own")
    researcher.get("/admin/drafts/new")
    researcher.post("/admin/drafts", template="external_predictor", name="mine_1", title="My study: one")
    (draft,) = site.database.read_now(study_drafts.every)
    text = (Path(__file__).parents[4] / "studies" / "external_predictor.yaml").read_text("utf-8")
    same = set(text.splitlines()) & set(draft.source.splitlines())
    assert len(same) > 0.9 * len(set(text.splitlines())), "the rest is the template, word for word"
    assert "name: mine_1" in draft.source
    assert 'title: {en: "My study: one", zh: "My study: one"}' in draft.source
    assert "seed: 20250601" not in draft.source


@pytest.mark.parametrize("name", ["", "Pilot", "small", "../x", "a" * 41])
def test_a_name_that_cannot_be_used_is_refused_and_what_was_typed_stays(site: PageSite, name: str) -> None:
    researcher = signed_in(site, "own")
    researcher.get("/admin/drafts/new")
    page = researcher.post("/admin/drafts", template="quick_look", name=name, title="My words")
    assert page.status_code == 422
    assert "My words" in page.text
    assert site.database.read_now(study_drafts.every) == []


def test_the_text_is_checked_with_the_words_of_the_loader_at_line_and_field(site: PageSite) -> None:
    researcher = signed_in(site, "own")
    draft = begun(site, researcher)
    text = source(site, draft)
    assert all(one["warning"] for one in asked(researcher, draft, "look", text=text)[1]["problems"])
    broken = text.replace("seed: 11", "sed: 11")
    _, view = asked(researcher, draft, "look", text=broken)
    line = broken.splitlines().index("sed: 11") + 1
    assert {"line": line, "path": ["sed"], "warning": False} == {
        key: value for key, value in view["problems"][0].items() if key != "text"
    } or any(one["line"] == line and one["path"] == ["sed"] for one in view["problems"])
    assert any("Did you mean 'seed'?" in one["text"] for one in view["problems"])
    _, view = asked(researcher, draft, "look", text="name: [")
    assert view["values"] is None
    assert "this is not YAML" in view["problems"][0]["text"]
    unknown = text.replace("name: matrix", "name: matrx")
    _, view = asked(researcher, draft, "look", text=unknown)
    assert unknown != text
    assert any(one["path"][0] == "layouts" for one in view["problems"]), "kitchens are looked for too"


def test_a_change_from_the_form_is_made_in_the_text(site: PageSite) -> None:
    researcher = signed_in(site, "own")
    draft = begun(site, researcher)
    text = source(site, draft)
    change = {"do": "put", "path": ["duration_min"], "value": "17", "plain": True}
    _, view = asked(researcher, draft, "look", text=text, operation=json.dumps(change))
    assert view["values"]["duration_min"] == "17"
    assert "\nduration_min: 17\n" in view["text"]
    for empty in (None, ""):
        nothing = {"do": "put", "path": ["tutorial", "agent", "name"], "value": empty}
        assert asked(researcher, draft, "look", text=text, operation=json.dumps(nothing))[1]["text"] == text
    for operation in ("{", '{"do": "put"}', '{"do": "fly", "path": []}', '{"do": "remove", "path": ["no"]}', "[[[["):
        status, view = asked(researcher, draft, "look", text=text, operation=operation)
        assert (status, view["text"]) == (200, text)
        assert view["refused"], operation
    assert source(site, draft) == text, "looking stores nothing"


def test_of_two_editors_of_the_same_draft_one_gets_both_texts(site: PageSite) -> None:
    mara, tab = signed_in(site, "own"), signed_in(site, "own")
    draft = begun(site, mara)
    tab.get(f"/admin/drafts/{draft}")
    text = source(site, draft)
    status, answer = asked(mara, draft, "save", text=f"{text}# hers\n", revision="2")
    assert (status, answer["revision"]) == (200, 3)
    status, answer = asked(tab, draft, "save", text=f"{text}# his\n", revision="2")
    assert status == 409
    assert (answer["text"], answer["revision"]) == (f"{text}# hers\n", 3)
    kept = [one.source for one in site.database.read_now(study_drafts.history, draft)]
    assert {f"{text}# hers\n", f"{text}# his\n"} <= set(kept)
    assert asked(tab, draft, "save", text=f"{text}# both\n", revision="3", note="merged")[0] == 200
    assert source(site, draft) == f"{text}# both\n"


def test_changes_of_two_to_different_parts_become_one_text(site: PageSite) -> None:
    mara, tab = signed_in(site, "own"), signed_in(site, "own")
    draft = begun(site, mara)
    tab.get(f"/admin/drafts/{draft}")
    text = source(site, draft)
    hers, his = text.replace("seed: 1", "seed: 2"), f"{text}# his\n"
    assert asked(mara, draft, "save", text=hers, revision="2", base=text)[0] == 200
    status, answer = asked(tab, draft, "save", text=his, revision="2", base=text)
    assert (status, answer["revision"], answer["text"]) == (200, 4, f"{hers}# his\n")
    assert source(site, draft) == answer["text"]
    # He has written on before the answer came: what he sent is now the text that both had.
    status, answer = asked(tab, draft, "save", text=f"{text}# his, longer\n", revision="2", base=his)
    assert (status, answer["text"]) == (200, f"{hers}# his, longer\n")
    assert not any(one.note == "set aside" for one in site.database.read_now(study_drafts.history, draft))


def test_a_part_that_two_changed_is_a_conflict_of_this_part_alone(site: PageSite) -> None:
    mara, tab = signed_in(site, "own"), signed_in(site, "own")
    draft = begun(site, mara)
    tab.get(f"/admin/drafts/{draft}")
    text = source(site, draft)
    asked(mara, draft, "save", text=text.replace("seed: 1", "seed: 2"), revision="2", base=text)
    mine = f"{text.replace('seed: 1', 'seed: 3')}# his\n"
    status, answer = asked(tab, draft, "save", text=mine, revision="2", base=text)
    before, conflict, after = answer["parts"]
    assert (status, conflict) == (409, {"theirs": "seed: 21\n", "mine": "seed: 31\n"})
    assert f"{before}seed: 21\n{after}" == f"{source(site, draft)}# his\n"
    (kept,) = [one for one in site.database.read_now(study_drafts.history, draft) if one.note == "set aside"]
    assert kept.source == mine


def test_a_page_whose_last_answer_was_lost_has_no_conflict_with_itself(site: PageSite) -> None:
    tab = signed_in(site, "own")
    draft = begun(site, tab)
    text = source(site, draft)
    lost = f"{text}# his\n"
    assert asked(tab, draft, "save", text=lost, revision="2", base=text)[0] == 200
    hers = DraftText("another", lost.replace("seed: 1", "seed: 2"), "pilot", 3)
    site.database.write_now(study_drafts.save, draft, hers)
    status, answer = asked(tab, draft, "save", text=f"{text}# better\n", revision="2", base=text, before=lost)
    assert (status, answer["text"]) == (200, f"{text.replace('seed: 1', 'seed: 2')}# better\n")


def test_an_earlier_text_is_looked_at_and_restored(site: PageSite) -> None:
    researcher = signed_in(site, "own")
    draft = begun(site, researcher)
    first = site.database.read_now(study_drafts.history, draft)[-1]
    assert first.note == "created"
    page = researcher.get(f"/admin/drafts/{draft}/history/{first.id}")
    assert "Restore this text" in page.text
    assert researcher.post(f"/admin/drafts/{draft}/restore", version=str(first.id)).status_code == 200
    assert source(site, draft) == first.source
    history = site.database.read_now(study_drafts.history, draft)
    assert [one.note for one in history] == ["restored", "edited", "created"]


@pytest.mark.parametrize("route", ["save", "aside"])
def test_a_text_with_a_nul_character_is_refused_and_changes_nothing(site: PageSite, route: str) -> None:
    """PostgreSQL cannot store it, which was an error of the server."""
    researcher = signed_in(site, "own")
    draft = begun(site, researcher)
    before = source(site, draft)
    status, answer = asked(researcher, draft, route, text=f"{before}# \x00\n", revision="2")
    assert (status, answer["detail"][:36]) == (400, "The text contains a NUL character. D")
    assert source(site, draft) == before


def test_games_and_pages_do_not_wait_for_a_text_that_is_rendered(
    site: PageSite, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A text of 60,000 brackets takes a second."""
    researcher, other = signed_in(site, "own"), signed_in(site, "act")
    draft = begun(site, researcher)
    begun_to_render, other_page_came = threading.Event(), threading.Event()

    def render(_: str) -> str:
        begun_to_render.set()
        return "in time" if other_page_came.wait(5) else "the other page had to wait"

    monkeypatch.setitem(site.services.web.templates.filters, "markdown", render)
    with ThreadPoolExecutor(1) as threads:
        answer = threads.submit(asked, researcher, draft, "markdown", text="[" * 10)
        assert begun_to_render.wait(10)
        other.get("/admin/audit")
        other_page_came.set()
        assert answer.result() == (200, {"html": "in time"})
