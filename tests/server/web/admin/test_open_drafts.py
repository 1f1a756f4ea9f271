"""Drafts from opening to closing: what is served of them, to whom, and what is refused."""

import asyncio
import shutil
import time
from dataclasses import replace
from pathlib import Path
from typing import Any

import httpx
import pytest

from models.networks.checkpoint import load_checkpoint
from overcooked.layout import load_layout
from server.monitoring import rehearsals
from server.participation.served_studies import Studies
from server.required_models import WEIGHTS
from server.store import audit, kitchens, participants, studies, study_openings
from server.store.database import Database
from server.study.loader import load_study, parse_study
from tests.support.draft_site import admin_site_fixture as admin_site_fixture
from tests.support.draft_site import asked, begun, opened, source, versions_of
from tests.support.draft_site import file as file
from tests.support.draft_site import site as site
from tests.support.page_site import SMALL_STUDY, PageSite, Visitor
from tests.support.researcher_site import signed_in


def test_a_study_is_opened_taken_part_in_changed_and_closed(site: PageSite, file: Path) -> None:
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
    refused = Visitor(site).get("/s/pilot")
    assert refused.status_code == 409
    assert "This study has ended" in refused.text, "not that its places are taken"
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


def test_pausing_and_resuming_from_a_draft_leads_back_to_it(site: PageSite) -> None:
    researcher = signed_in(site, "own")
    draft = begun(site, researcher)
    opened(researcher, draft, 2)
    for route, said in (("pause", "The study is paused"), ("resume", "The study continues")):
        page = researcher.post(f"/admin/s/pilot/{route}", note="a break", next=f"/admin/drafts/{draft}")
        assert page.url.path == f"/admin/drafts/{draft}"
        assert said in page.text


def test_a_draft_may_name_a_kitchen_of_the_dashboard_and_is_opened_with_its_grid(site: PageSite) -> None:
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


def test_a_draft_may_name_models_that_were_trained_here_and_its_version_keeps_them(
    site: PageSite, file: Path, tmp_path: Path
) -> None:
    researcher, ring, models = signed_in(site, "own"), WEIGHTS / "coordination_ring", tmp_path / "models" / "nook"
    draft = begun(site, researcher)
    site.database.write_now(kitchens.save, "nook", load_layout("coordination_ring").text, "ada", 0)
    text = source(site, draft).replace("{name: coordination_ring,", "{name: nook,").replace("after: [2]", "after: [1]")
    text = text.replace("  - {name: matrix, title: {en: Matrix, zh: 矩阵}}\n", "")
    text = text.replace("{name: planner, predictor: random}", "{name: mine}")
    seen = asked(researcher, draft, "look", text=text)[1]
    assert (seen["own"], seen["problems"][0]["path"]) == ({}, ["agents", 0, "name"])
    shutil.copytree(ring / "sp", models / "mine")
    shutil.copytree(ring / "sp_predictor_stream", models / "mine_predictor_stream")
    seen = asked(researcher, draft, "look", text=text)[1]
    assert seen["own"] == {"nook": {"agents": ["mine"], "predictors": ["mine_predictor_stream"]}}
    assert [one for one in seen["problems"] if not one["warning"]] == []
    assert asked(researcher, draft, "save", text=text, revision="2")[0] == 200
    assert "The study is open" in opened(researcher, draft, 3)
    (version,) = site.database.read_now(studies.every, "pilot")
    played = load_checkpoint(ring / "sp").sha256
    assert parse_study(version.source).study.checkpoints["nook/mine"] == played
    assert load_checkpoint(models.parent / ".kept" / played).sha256 == played
    assert "checkpoints" not in source(site, draft)
    shutil.rmtree(models / "mine")
    shutil.copytree(ring / "fcp", models / "mine")
    found = [one["text"] for one in asked(researcher, draft, "look", text=text)[1]["problems"] if not one["warning"]]
    assert [line for line in found if "has been trained again" in line]

    async def started(several: bool) -> tuple[str, ...]:
        """What a process serves that starts now, with the kept models."""
        studies = await Studies.opened(site.database, [load_study(file)])
        await versions_of(site.database, studies, file, several).begin(site.database)
        return studies.names()

    assert asyncio.run(started(False)) == asyncio.run(started(True)) == ("small", "pilot")


def test_untrained_kitchens_and_predictions_that_guess_are_warnings_here_and_on_the_study_s_page(
    site: PageSite, tmp_path: Path
) -> None:
    researcher = signed_in(site, "own")
    draft = begun(site, researcher)
    site.database.write_now(kitchens.save, "nook", "XXPXX\nO1 2O\nX   X\nXDXSX", "ada", 0)
    text = source(site, draft).replace("{name: coordination_ring,", "{name: nook,")
    asked(researcher, draft, "save", text=text, revision="2")
    kitchen, first, *_ = asked(researcher, draft, "look", text=text)[1]["problems"]
    assert (kitchen["warning"], kitchen["path"]) == (True, ["layouts", 0, "name"])
    assert "only scripted agents play in nook, which was drawn by hand" in kitchen["text"]
    assert (
        f"--layout {tmp_path}/kitchens/nook.layout --out {tmp_path}/models/nook/nook_agent` (it reads"
        in kitchen["text"]
    )
    assert (first["warning"], first["path"]) == (True, ["agents", 0, "predictor"])
    words = "ondition `with` shows predictions of planner in nook, matrix, and `random` guesses at random"
    command = f"kitchenmind train predictor --layout {tmp_path}/kitchens/nook.layout --agent planner"
    assert words in first["text"]
    assert command in first["text"]
    opened(researcher, draft, 3)
    page = researcher.get("/admin/s/pilot").text
    assert words.replace("`with`", "<code>with</code>").replace("`random`", "<code>random</code>") in page
    assert f"<code>{command}" in page


def test_an_open_study_is_served_after_a_restart_and_by_another_process(site: PageSite, file: Path) -> None:
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


def test_a_faulty_study_and_one_that_has_changed_are_not_opened(site: PageSite) -> None:
    researcher = signed_in(site, "own")
    draft = begun(site, researcher)
    text = source(site, draft)
    assert "somebody else has changed" in opened(researcher, draft, 1)
    asked(researcher, draft, "save", text=text.replace("seed: 11", "sed: 11"), revision="2")
    assert "correct the listed problems first" in opened(researcher, draft, 3)
    assert site.studies.open("pilot") is None


@pytest.mark.parametrize("model", ["os:system", "http://10.0.0.1/agent", "../secret.onnx", "../other/agent"])
def test_a_draft_names_no_file_class_or_address_of_the_server(site: PageSite, model: str) -> None:
    researcher = signed_in(site, "own")
    draft = begun(site, researcher)
    text = source(site, draft)
    changed = text.replace("name: planner,", f'name: planner, model: "{model}",')
    assert changed != text
    _, view = asked(researcher, draft, "look", text=changed)
    assert any("Name a bundled agent" in one["text"] for one in view["problems"]), view["problems"]
    asked(researcher, draft, "save", text=changed, revision="2")
    assert "correct the listed problems first" in opened(researcher, draft, 3)
    rehearsed = researcher.post(f"/admin/drafts/{draft}/bots", number="1")
    assert "correct the listed problems first" in rehearsed.text, "its bots would load the model"
    assert site.services.rehearsals.of(draft) is None


@pytest.mark.parametrize("number", ["0", "41", "00062000", "1" * 5000, "-1", "x"])
def test_a_rehearsal_has_at_most_forty_bots(site: PageSite, number: str) -> None:
    researcher = signed_in(site, "own")
    draft = begun(site, researcher)
    assert researcher.post(f"/admin/drafts/{draft}/bots", number=number).status_code == 400
    assert site.services.rehearsals.of(draft) is None


def test_a_name_that_was_taken_while_the_models_were_loaded_stays_with_the_first(
    site: PageSite, monkeypatch: pytest.MonkeyPatch
) -> None:
    researcher = signed_in(site, "own")
    one, two = begun(site, researcher), begun(site, researcher, name="other")
    text = source(site, two).replace("name: other", "name: pilot")
    asked(researcher, two, "save", text=text, revision="2")
    taken = study_openings.is_taken
    monkeypatch.setattr(study_openings, "is_taken", lambda connection, *names: False)  # the first look
    prepare = site.services.versions.prepare_draft

    async def saved_in_between(database: Database, file: Any) -> Any:
        made = await prepare(database, file)
        database.write_now(study_openings.open_study, ("pilot", made[1]), (one, 2), "ben")
        monkeypatch.setattr(study_openings, "is_taken", taken)
        return made

    monkeypatch.setattr(site.services.versions, "prepare_draft", saved_in_between)
    assert "another draft with this name is open" in opened(researcher, two, 3)
    assert site.database.read_now(study_openings.newest)["pilot"].draft_id == one


def test_an_open_study_is_closed_before_its_draft_is_deleted(site: PageSite) -> None:
    researcher = signed_in(site, "own")
    draft = begun(site, researcher)
    opened(researcher, draft, 2)
    assert "close the study first" in researcher.post(f"/admin/drafts/{draft}/delete").text
    researcher.post(f"/admin/drafts/{draft}/close", study="pilot")
    assert "The draft is deleted" in researcher.post(f"/admin/drafts/{draft}/delete").text
    assert researcher.get(f"/admin/drafts/{draft}").status_code == 404


def test_bots_take_part_in_a_draft_and_the_audit_log_has_the_outcome(
    site: PageSite, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
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


def test_the_name_of_a_study_from_a_file_stays_with_the_file(site: PageSite) -> None:
    researcher = signed_in(site, "own")
    draft = begun(site, researcher)
    before = site.studies.open("small")
    asked(researcher, draft, "save", text=SMALL_STUDY.replace("seed: 11", "seed: 13"), revision="2")
    _, view = asked(researcher, draft, "look", text=SMALL_STUDY)
    assert [(one["path"], one["line"]) for one in view["problems"]] == [(["name"], 2)]
    assert "correct the listed problems first" in opened(researcher, draft, 3)
    assert site.studies.open("small") == before


def test_an_answer_is_extracted_from_a_text_that_is_too_long(site: PageSite) -> None:
    researcher = signed_in(site, "own")
    draft = begun(site, researcher)
    status, answer = asked(researcher, draft, "save", text="x" * 300_001, revision="2")
    assert status == 413
    assert "300,000" in answer["detail"]
    with pytest.raises(httpx.HTTPError):
        researcher.get("/admin/drafts/77").raise_for_status()
