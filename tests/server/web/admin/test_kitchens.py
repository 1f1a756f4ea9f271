"""The kitchen editor's routes over real HTTP: errors with their place, saving, conflicts, planners."""

import shlex
import shutil
from pathlib import Path
from typing import Any

import httpx
import pytest

from overcooked.layout import load_layout
from server.required_models import WEIGHTS
from server.store import audit, kitchens
from server.web.admin import kitchen_findings, kitchen_pages
from tests.support.page_site import PageSite
from tests.support.researcher_site import Researcher, signed_in
from tests.support.researcher_site import site as admin_site

site = admin_site
GRID = "XXPXX\nO1 2O\nX   X\nXDXSX"
DICTIONARY = '{"grid": """XXPXX\n   O1 2O\n   X   X\n   XDXSX""", "start_order_list": None, "cook_time": 20}'


@pytest.fixture
def owner(site: PageSite) -> Researcher:
    site.app.include_router(kitchen_pages.router)
    return signed_in(site, "own")


def ask(owner: Researcher, path: str, **fields: str) -> httpx.Response:
    """Send a form as the editor does; the page with the form is asked for again."""
    owner.client.headers["accept"] = "text/html"
    owner.get("/admin/kitchens")
    owner.get("/admin")
    owner.client.headers["accept"] = "application/json"
    token = owner.token()
    return owner.post(f"/admin/kitchens/{path}", token, **fields)


def test_errors_come_with_their_place_and_in_the_loaders_words(owner: Researcher) -> None:
    found = ask(owner, "check", grid="XX X\nXT1X\nXXXX", name="nook").json()
    assert found["rows"] == ["XX X", "XT1X", "XXXX"]
    assert {"row": 1, "column": 3, "text": "The border is open here. Close it with X or a station."} in found[
        "problems"
    ]
    assert any(one["text"].startswith("Tomatoes (T) are not served") for one in found["problems"])
    assert found["reach"] is None


def test_a_valid_grid_is_returned_with_reach_models_and_commands(owner: Researcher) -> None:
    found = ask(owner, "check", grid=GRID, name="nook").json()
    assert (found["problems"], found["reach"]["together"]) == ([], True)
    assert found["models"]["agents"] == []
    assert not found["models"]["is_saved"], "the commands would not find its file"
    ring = ask(owner, "check", grid=load_layout("coordination_ring").text, name="mine").json()["models"]
    assert ring["layout"] == "coordination_ring"
    assert "sp_predictor_stream" in ring["predictors"]


def test_another_grid_under_the_name_of_a_bundled_kitchen_gets_no_commands_for_that_one(owner: Researcher) -> None:
    found = ask(owner, "check", grid=GRID, name="cramped_room").json()["models"]
    assert (found["is_taken"], found["is_saved"], found["agents"]) == (True, False, [])
    found = ask(owner, "check", grid=load_layout("cramped_room").text, name="cramped_room").json()["models"]
    assert (found["is_taken"], found["is_saved"]) == (False, True)
    assert "sp" in found["agents"]


def test_the_commands_of_a_saved_kitchen_read_its_file_and_what_they_make_is_found(
    owner: Researcher, tmp_path: Path
) -> None:
    ring = load_layout("coordination_ring").text
    ask(owner, "save", name="nook", grid=ring, version="0")
    found = ask(owner, "check", grid=ring, name="nook").json()["models"]
    assert found["is_saved"]
    words = shlex.split(found["commands"][0])
    assert shutil.which(words[0]), "it works as it stands, also where no environment is activated"
    assert load_layout(words[words.index("--layout") + 1]).text == ring
    shutil.copytree(WEIGHTS / "coordination_ring" / "sp", words[words.index("--out") + 1])  # instead of training
    found = ask(owner, "check", grid=ring, name="nook").json()["models"]
    assert (found["layout"], found["agents"]) == ("nook", ["nook_agent"])
    other = ask(owner, "check", grid=GRID, name="nook").json()["models"]
    assert (other["is_saved"], other["agents"], other["other_grid"]) == (False, [], ["nook_agent"])
    owner.client.headers["accept"] = "text/html"
    owner.get("/admin/kitchens")
    owner.post("/admin/kitchen/nook/remove")
    assert list((tmp_path / "kitchens").iterdir()) == []


def test_a_file_of_overcooked_ai_is_read_and_another_rule_is_refused_with_its_reason(owner: Researcher) -> None:
    found = ask(owner, "check", grid=DICTIONARY).json()
    assert (found["rows"], found["problems"]) == (GRID.splitlines(), [])
    refused = ask(owner, "check", grid=DICTIONARY.replace("20", "5")).json()
    assert refused["rows"] is None
    assert "cook_time = 5 is not supported" in refused["problems"][0]["text"].lower()


def test_a_kitchen_is_saved_listed_and_changed_with_a_line_in_the_audit_log(owner: Researcher, site: PageSite) -> None:
    assert ask(owner, "save", name="nook", grid=GRID, version="0").json() == {"name": "nook", "version": 1}
    assert ask(owner, "save", name="nook", grid=GRID.replace("1 2", "2 1"), version="1").json()["version"] == 2
    owner.client.headers["accept"] = "text/html"
    assert "nook" in owner.get("/admin/kitchens").text
    assert "Version 1</a>" in owner.get("/admin/kitchen/nook").text
    noted = [(one.action, one.detail) for one in site.database.read_now(audit.entries)[-2:]]
    assert noted == [("save kitchen", {"kitchen": "nook", "version": version}) for version in (1, 2)]


def test_two_people_who_change_one_kitchen_see_the_conflict(owner: Researcher, site: PageSite) -> None:
    ask(owner, "save", name="nook", grid=GRID, version="0")
    site.database.write_now(kitchens.save, "nook", GRID.replace("1 2", "2 1"), "ben", 1)
    refused = ask(owner, "save", name="nook", grid=GRID, version="1")
    assert refused.status_code == 409
    assert refused.json() == {"detail": "ben saved version 2 of nook in the meantime", "newest": 2}
    assert ask(owner, "save", name="nook", grid=GRID, version="2").json()["version"] == 3


@pytest.mark.parametrize(
    ("fields", "reason"),
    [
        ({"name": "My Nook!"}, "'My Nook!' cannot be the name. Use lowercase letters"),
        ({"name": "My Nook!"}, "for example my_nook"),
        ({"name": ""}, "Give the kitchen a name"),
        ({"name": "matrix"}, "bundled kitchen"),
        ({"name": "random0"}, "bundled kitchen"),
        ({"grid": GRID.replace("P", "X")}, "there is no pot"),
        ({"version": "-1"}, "no valid version"),
        ({"grid": "X" * 30_000}, "at most"),
    ],
)
def test_an_invalid_kitchen_is_refused_with_its_reason(
    owner: Researcher, site: PageSite, fields: dict[str, str], reason: str
) -> None:
    refused = ask(owner, "save", **({"name": "nook", "grid": GRID, "version": "0"} | fields))
    assert refused.status_code == 400
    assert reason in refused.json()["detail"]
    assert site.database.read_now(kitchens.newest) == []


def test_a_kitchen_in_which_a_served_study_plays_is_neither_changed_nor_removed(
    owner: Researcher, site: PageSite, monkeypatch: pytest.MonkeyPatch
) -> None:
    ask(owner, "save", name="nook", grid=GRID, version="0")
    number, study = site.studies.open("small") or (0, None)
    assert study is not None
    own = study.layouts[0].model_copy(update={"name": "nook", "grid": GRID})
    changed = study.model_copy(update={"layouts": (own, *study.layouts[1:])})
    monkeypatch.setattr(site.studies, "open", lambda _: (number, changed))
    refused = ask(owner, "save", name="nook", grid=GRID.replace("1 2", "2 1"), version="1")
    assert (refused.status_code, "another name" in refused.json()["detail"]) == (409, True)
    owner.client.headers["accept"] = "text/html"
    owner.get("/admin/kitchens")
    assert owner.post("/admin/kitchen/nook/remove").status_code == 409
    monkeypatch.undo()
    owner.get("/admin/kitchens")
    owner.post("/admin/kitchen/nook/remove")
    assert "The kitchen is removed." in owner.page.text
    assert site.database.read_now(kitchens.grids) == {}


def test_planners_play_a_kitchen_in_another_process_and_the_result_is_kept(
    owner: Researcher, monkeypatch: pytest.MonkeyPatch
) -> None:
    found = ask(owner, "trial", grid=GRID).json()
    assert len(found["points"]) == kitchen_findings.EPISODES
    assert 0 <= found["blocked"] <= 1

    def nothing(_: str) -> Any:
        raise AssertionError("played it again")

    monkeypatch.setattr(kitchen_findings, "_tried", nothing)
    assert ask(owner, "trial", grid=GRID).json() == found
    assert ask(owner, "check", grid=GRID, name="nook").json()["trial"] == found
    assert ask(owner, "trial", grid="XXX").status_code == 400


@pytest.mark.parametrize("role", ["watch", "act"])
def test_others_than_owners_see_no_kitchens(site: PageSite, role: str) -> None:
    site.app.include_router(kitchen_pages.router)
    visitor = signed_in(site, role)
    assert visitor.get("/admin/kitchens").status_code == 403
    assert "/admin/kitchens" not in visitor.get("/admin").text
