"""Studies that are written in the dashboard: drafts, their checks, conflicts, and from opening to closing."""

import asyncio
import json
import time
from contextlib import AsyncExitStack
from dataclasses import replace
from pathlib import Path
from typing import Any
from urllib.parse import urlencode

import httpx
import pytest
from fastapi.routing import APIRoute
from websockets import InvalidStatus, Origin
from websockets.sync.client import connect

from server.monitoring import rehearsals
from server.monitoring.rehearsals import Rehearsals
from server.participation.served_studies import Studies
from server.participation.study_versions import StudyVersions
from server.settings import Settings
from server.store import audit, kitchens, participants, studies, study_drafts, study_openings
from server.store.database import Database
from server.store.study_drafts import DraftText
from server.study.loader import load_study
from server.web.admin import draft_routes
from tests.server.participation.test_study_versions import AddedModels
from tests.support.page_site import SMALL_STUDY, Site, Visitor
from tests.support.researcher_site import Researcher, signed_in
from tests.support.researcher_site import site as admin_site

admin_site_fixture = admin_site


@pytest.fixture
def file(tmp_path: Path) -> Path:
    path = tmp_path / "small.yaml"
    path.write_text(SMALL_STUDY, encoding="utf-8")
    return path


async def nobody() -> list[Any]:
    """The other processes."""
    return []


def versions_of(database: Database, studies: Studies, file: Path, several: bool = False) -> StudyVersions:
    settings = Settings(database=f"sqlite:///{file.parent}/site.db")
    models: Any = AddedModels()
    return StudyVersions(settings, [load_study(file)], models, studies, nobody if several else None)


@pytest.fixture
def site(admin_site_fixture: Site, file: Path) -> Site:
    made = admin_site_fixture
    versions, stack = versions_of(made.database, made.studies, file), AsyncExitStack()
    made.use(replace(made.services, versions=versions, rehearsals=Rehearsals(stack), games=[]))  # type: ignore[arg-type]
    made.app.include_router(draft_routes.router)
    return made


def begun(site: Site, researcher: Researcher, name: str = "pilot") -> int:
    """A draft that is made from the shortest template; its number."""
    researcher.get("/admin/drafts/new")
    page = researcher.post("/admin/drafts", template="quick_look", name=name, title="A pilot")
    assert page.status_code == 200, page.text[:400]
    (draft, *_) = site.database.read_now(study_drafts.every)
    assert page.url.path == f"/admin/drafts/{draft.id}"
    # The small study has agents that need no weights.
    text = SMALL_STUDY.replace("name: small", f"name: {name}")
    assert asked(researcher, draft.id, "save", text=text, revision="1")[0] == 200
    researcher.get(f"/admin/drafts/{draft.id}")
    return draft.id


def asked(researcher: Researcher, draft: int, route: str, **fields: str) -> tuple[int, Any]:
    """Send what the page's script sends."""
    body = urlencode({"form_token": researcher.token(), **fields})
    headers = {"content-type": "application/x-www-form-urlencoded", "accept": "application/json"}
    answer = researcher.client.post(f"/admin/drafts/{draft}/{route}", content=body, headers=headers)
    return answer.status_code, answer.json()


def source(site: Site, draft: int) -> str:
    found = site.database.read_now(study_drafts.get, draft)
    assert found is not None
    return found.source


def opened(researcher: Researcher, draft: int, revision: int) -> str:
    researcher.get(f"/admin/drafts/{draft}")
    return researcher.post(f"/admin/drafts/{draft}/open", revision=str(revision)).text


def test_drafts_are_for_owners_only(site: Site) -> None:
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


def test_a_form_from_elsewhere_changes_no_draft(site: Site) -> None:
    researcher = signed_in(site, "own")
    draft = begun(site, researcher)
    before = source(site, draft)
    for token in ("", "made up"):
        body = urlencode({"form_token": token, "text": "gone", "revision": "2"})
        headers = {"content-type": "application/x-www-form-urlencoded"}
        answer = researcher.client.post(f"/admin/drafts/{draft}/save", content=body, headers=headers)
        assert answer.status_code == 403
    assert source(site, draft) == before


def test_a_new_study_begins_from_a_template_with_its_own_name_title_and_seed(site: Site) -> None:
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
def test_a_name_that_cannot_be_used_is_refused_and_what_was_typed_stays(site: Site, name: str) -> None:
    researcher = signed_in(site, "own")
    researcher.get("/admin/drafts/new")
    page = researcher.post("/admin/drafts", template="quick_look", name=name, title="My words")
    assert page.status_code == 422
    assert "My words" in page.text
    assert site.database.read_now(study_drafts.every) == []


def test_the_text_is_checked_with_the_words_of_the_loader_at_line_and_field(site: Site) -> None:
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
    assert "this is no YAML" in view["problems"][0]["text"]
    unknown = text.replace("name: matrix", "name: matrx")
    _, view = asked(researcher, draft, "look", text=unknown)
    assert unknown != text
    assert any(one["path"][0] == "layouts" for one in view["problems"]), "kitchens are looked for too"


def test_a_change_from_the_form_is_made_in_the_text(site: Site) -> None:
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


def test_of_two_editors_of_the_same_draft_one_gets_both_texts(site: Site) -> None:
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


def test_changes_of_two_to_different_parts_become_one_text(site: Site) -> None:
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


def test_a_part_that_two_changed_is_a_conflict_of_this_part_alone(site: Site) -> None:
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


def test_a_page_whose_last_answer_was_lost_has_no_conflict_with_itself(site: Site) -> None:
    tab = signed_in(site, "own")
    draft = begun(site, tab)
    text = source(site, draft)
    lost = f"{text}# his\n"
    assert asked(tab, draft, "save", text=lost, revision="2", base=text)[0] == 200
    hers = DraftText("another", lost.replace("seed: 1", "seed: 2"), "pilot", 3)
    site.database.write_now(study_drafts.save, draft, hers)
    status, answer = asked(tab, draft, "save", text=f"{text}# better\n", revision="2", base=text, before=lost)
    assert (status, answer["text"]) == (200, f"{text.replace('seed: 1', 'seed: 2')}# better\n")


def test_an_earlier_text_is_looked_at_and_restored(site: Site) -> None:
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


def test_a_study_is_opened_taken_part_in_changed_and_closed(site: Site, file: Path) -> None:
    researcher = signed_in(site, "own")
    draft = begun(site, researcher)
    assert Visitor(site).get("/s/pilot").status_code == 404
    assert "The study is open" in opened(researcher, draft, 2)
    early = Visitor(site)
    early.consent("pilot")
    first = site.only("pilot")
    text = source(site, draft)
    asked(researcher, draft, "save", text=text.replace("seed: 11", "seed: 12"), revision="2")
    assert "Open, changed since" in researcher.get("/admin/drafts").text
    assert site.studies.of(first).seed == 11, "what was opened never changes"
    assert "The study is open" in opened(researcher, draft, 3)
    Visitor(site).consent("pilot")
    assert site.studies.of(site.everybody("pilot")[0]).seed == 12
    assert site.studies.of(first).seed == 11
    assert f"{site.url}/s/pilot" in researcher.get(f"/admin/drafts/{draft}").text
    closed = researcher.post(f"/admin/drafts/{draft}/close", study="pilot").text
    assert "The study is closed" in closed
    assert 'href="/admin/s/pilot"' in closed
    assert Visitor(site).get("/s/pilot").status_code == 409
    assert "/s/pilot" not in Visitor(site).get("/").text
    assert early.get("/s/pilot/now").status_code == 200, "participants who have begun continue"
    assert early.get("/s/pilot/withdraw").status_code == 200
    actions = [entry.action for entry in site.database.read_now(audit.entries)]
    assert [one for one in actions if "study" in one and "draft" not in one] == [
        "open study",
        "open study",
        "close study",
    ]
    site.studies._open.pop("pilot")  # as after a restart: nobody new is let in
    assert 'href="/admin/s/pilot"' in researcher.get("/admin").text
    assert ">Closed</span>" in researcher.get("/admin/s/pilot").text


def test_a_draft_may_name_a_kitchen_of_the_dashboard_and_is_opened_with_its_grid(site: Site) -> None:
    researcher, grid = signed_in(site, "own"), "XXPXX\nO1 2O\nX   X\nXDXSX"
    draft = begun(site, researcher)
    text = source(site, draft).replace("{name: coordination_ring,", "{name: nook,")
    assert "nook" in text
    assert any("nook" in one["text"] for one in asked(researcher, draft, "look", text=text)[1]["problems"])
    site.database.write_now(kitchens.save, "nook", grid, "ada", 0)
    assert [one for one in asked(researcher, draft, "look", text=text)[1]["problems"] if not one["warning"]] == []
    assert asked(researcher, draft, "save", text=text, revision="2")[0] == 200
    assert '"nook"' in researcher.get(f"/admin/drafts/{draft}").text, "the form suggests it"
    assert researcher.get(f"/admin/drafts/{draft}/preview").status_code == 200
    assert "The study is open" in opened(researcher, draft, 3)
    assert "grid" not in source(site, draft)
    assert "Open, changed since" not in researcher.get("/admin/drafts").text
    (version,) = (one for one in site.database.read_now(studies.every, "pilot"))
    assert grid.splitlines()[1] in version.source


def test_untrained_kitchens_and_predictions_that_guess_are_warnings_here_and_on_the_study_s_page(
    site: Site,
) -> None:
    researcher = signed_in(site, "own")
    draft = begun(site, researcher)
    site.database.write_now(kitchens.save, "nook", "XXPXX\nO1 2O\nX   X\nXDXSX", "ada", 0)
    text = source(site, draft).replace("{name: coordination_ring,", "{name: nook,")
    asked(researcher, draft, "save", text=text, revision="2")
    kitchen, first, *_ = asked(researcher, draft, "look", text=text)[1]["problems"]
    assert (kitchen["warning"], kitchen["path"]) == (True, ["layouts", 0, "name"])
    assert "only scripted agents play in nook, which was drawn by hand" in kitchen["text"]
    assert "kitchenmind train agent --layout nook.layout --out nook_agent" in kitchen["text"]
    assert (first["warning"], first["path"]) == (True, ["agents", 0, "predictor"])
    words = "ondition `with` shows predictions of planner in nook, matrix, and `random` guesses at random"
    command = "kitchenmind train predictor --layout nook.layout --agent planner"
    assert words in first["text"]
    assert command in first["text"]
    opened(researcher, draft, 3)
    page = researcher.get("/admin/s/pilot").text
    assert words in page
    assert command in page


def test_an_open_study_is_served_after_a_restart_and_by_another_process(site: Site, file: Path) -> None:
    researcher = signed_in(site, "own")
    draft = begun(site, researcher)
    opened(researcher, draft, 2)

    async def follows() -> tuple[str, ...]:
        """What a process serves that ran already."""
        studies = await Studies.opened(site.database, [load_study(file)])
        versions = versions_of(site.database, studies, file, several=True)
        versions._database = site.database
        await versions._follow()
        return studies.names()

    assert asyncio.run(follows()) == ("small", "pilot")

    async def started() -> Studies:
        studies = await Studies.opened(site.database, [load_study(file)])
        await versions_of(site.database, studies, file).begin(site.database)
        return studies

    studies = asyncio.run(started())
    assert set(studies.names()) == {"small", "pilot"}
    found = studies.open("pilot")
    assert found is not None
    assert found == site.studies.open("pilot")
    Visitor(site).consent("pilot")
    researcher.get(f"/admin/drafts/{draft}")
    researcher.post(f"/admin/drafts/{draft}/close", study="pilot")
    assert "pilot" in asyncio.run(started()).names(), "somebody is still in it"
    site.database.write_now(participants.leave, site.only("pilot").id, "returned")
    assert "pilot" not in asyncio.run(started()).names()


def test_a_faulty_study_and_one_that_has_changed_are_not_opened(site: Site) -> None:
    researcher = signed_in(site, "own")
    draft = begun(site, researcher)
    text = source(site, draft)
    assert "somebody else has changed" in opened(researcher, draft, 1)
    asked(researcher, draft, "save", text=text.replace("seed: 11", "sed: 11"), revision="2")
    assert "correct what the list of problems says" in opened(researcher, draft, 3)
    assert site.studies.open("pilot") is None


@pytest.mark.parametrize("model", ["os:system", "http://10.0.0.1/agent", "../secret.onnx", "../other/agent"])
def test_a_draft_names_no_file_class_or_address_of_the_server(site: Site, model: str) -> None:
    researcher = signed_in(site, "own")
    draft = begun(site, researcher)
    text = source(site, draft)
    changed = text.replace("name: planner,", f'name: planner, model: "{model}",')
    assert changed != text
    _, view = asked(researcher, draft, "look", text=changed)
    assert any("Name a bundled agent" in one["text"] for one in view["problems"]), view["problems"]
    asked(researcher, draft, "save", text=changed, revision="2")
    assert "correct what the list of problems says" in opened(researcher, draft, 3)
    rehearsed = researcher.post(f"/admin/drafts/{draft}/bots", number="1")
    assert "correct what the list of problems says" in rehearsed.text, "its bots would load the model"
    assert site.services.rehearsals.of(draft) is None


@pytest.mark.parametrize("number", ["0", "41", "00062000", "1" * 5000, "-1", "x"])
def test_a_rehearsal_has_at_most_forty_bots(site: Site, number: str) -> None:
    researcher = signed_in(site, "own")
    draft = begun(site, researcher)
    assert researcher.post(f"/admin/drafts/{draft}/bots", number=number).status_code == 400
    assert site.services.rehearsals.of(draft) is None


def test_a_name_that_was_taken_while_the_models_were_loaded_stays_with_the_first(
    site: Site, monkeypatch: pytest.MonkeyPatch
) -> None:
    researcher = signed_in(site, "own")
    one, two = begun(site, researcher), begun(site, researcher, name="other")
    text = source(site, two).replace("name: other", "name: pilot")
    asked(researcher, two, "save", text=text, revision="2")
    taken = study_openings.is_taken
    monkeypatch.setattr(study_openings, "is_taken", lambda connection, *names: False)  # the first look
    prepare = site.services.versions.prepare_draft

    async def meanwhile(database: Database, file: Any) -> Any:
        made = await prepare(database, file)
        database.write_now(study_openings.open_study, ("pilot", made[1]), (one, 2), "ben")
        monkeypatch.setattr(study_openings, "is_taken", taken)
        return made

    monkeypatch.setattr(site.services.versions, "prepare_draft", meanwhile)
    assert "another draft with this name is open" in opened(researcher, two, 3)
    assert site.database.read_now(study_openings.newest)["pilot"].draft_id == one


def test_an_open_study_is_closed_before_its_draft_is_deleted(site: Site) -> None:
    researcher = signed_in(site, "own")
    draft = begun(site, researcher)
    opened(researcher, draft, 2)
    assert "close the study first" in researcher.post(f"/admin/drafts/{draft}/delete").text
    researcher.post(f"/admin/drafts/{draft}/close", study="pilot")
    assert "The draft is deleted" in researcher.post(f"/admin/drafts/{draft}/delete").text
    assert researcher.get(f"/admin/drafts/{draft}").status_code == 404


def test_bots_walk_through_a_draft_and_the_audit_log_says_how_it_went(
    site: Site, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    outcome = {"started": 4, "completed": 3, "dropped": 1, "by_condition": {"with": 3}, "episodes": 9}
    program = tmp_path / "program.py"
    program.write_text(f"import json\nprint(json.dumps({outcome | {'violations': ['a violation']}!r}))")
    monkeypatch.setattr(rehearsals, "_PROGRAM", program)
    researcher = signed_in(site, "own")
    draft = begun(site, researcher)
    researcher.get(f"/admin/drafts/{draft}/bots")
    assert researcher.post(f"/admin/drafts/{draft}/bots", number="41").status_code == 400
    researcher.get(f"/admin/drafts/{draft}/bots")
    researcher.post(f"/admin/drafts/{draft}/bots", number="4")
    while "Running" in (text := researcher.get(f"/admin/drafts/{draft}/bots").text):
        time.sleep(0.05)
    assert "a violation" in text
    assert "completed in with" in text
    entry = site.database.read_now(audit.entries)[-1]
    assert (entry.action, entry.detail["completed"], entry.detail["violations"]) == ("study draft rehearsed", 3, 1)
    site.use(replace(site.services, games=["somebody plays"]))  # type: ignore[arg-type]
    assert "participants are playing" in researcher.post(f"/admin/drafts/{draft}/bots", number="4").text


def test_the_name_of_a_study_from_a_file_stays_with_the_file(site: Site) -> None:
    researcher = signed_in(site, "own")
    draft = begun(site, researcher)
    before = site.studies.open("small")
    asked(researcher, draft, "save", text=SMALL_STUDY.replace("seed: 11", "seed: 13"), revision="2")
    _, view = asked(researcher, draft, "look", text=SMALL_STUDY)
    assert [(one["path"], one["line"]) for one in view["problems"]] == [(["name"], 2)]
    assert "correct what the list of problems says" in opened(researcher, draft, 3)
    assert site.studies.open("small") == before


def test_an_answer_is_told_from_a_text_that_is_too_long(site: Site) -> None:
    researcher = signed_in(site, "own")
    draft = begun(site, researcher)
    status, answer = asked(researcher, draft, "save", text="x" * 300_001, revision="2")
    assert status == 413
    assert "300,000" in answer["detail"]
    with pytest.raises(httpx.HTTPError):
        researcher.get("/admin/drafts/77").raise_for_status()
