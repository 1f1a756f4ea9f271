"""Recorded games from a researcher's file, over real HTTP: simulated again, refused with a reason, never stored."""

import gzip
from pathlib import Path

import httpx
import pytest

from overcooked.layout import load_layout
from overcooked.trajectory import write_trajectories
from server.web.admin import opened_games_page
from server.web.admin.opened_games_page import TOKEN_HEADER
from tests.support.page_site import PageSite
from tests.support.researcher_site import Researcher, signed_in
from tests.support.researcher_site import site as admin_site

site = admin_site
PEOPLE = Path(__file__).parents[3] / "data" / "forced_coordination_train.jsonl.gz"


@pytest.fixture
def watcher(site: PageSite) -> Researcher:
    site.app.include_router(opened_games_page.router)
    return signed_in(site, "watch")


def send(watcher: Researcher, data: bytes, name: str, token: str | None = None) -> httpx.Response:
    watcher.client.headers["accept"] = "text/html"
    watcher.get("/admin/recordings")
    headers = {"accept": "application/json", TOKEN_HEADER: watcher.token() if token is None else token}
    return watcher.client.post("/admin/recordings/records.json", params={"name": name}, content=data, headers=headers)


def test_a_game_of_people_comes_back_with_all_its_states(watcher: Researcher) -> None:
    lines = gzip.decompress(PEOPLE.read_bytes()).splitlines(keepends=True)[:52]
    (record,) = send(watcher, gzip.compress(b"".join(lines)), "people.jsonl.gz").json()
    assert record["game"]["title"] == "forced_coordination"
    assert [row["t"] for row in record["rows"]] == list(range(51))
    assert record["rows"][0]["state"]["players"][0][:2] == [3, 1]


def test_trajectories_of_overcooked_ai_are_opened(watcher: Researcher, tmp_path: Path) -> None:
    file = tmp_path / "two.json"
    with file.open("w") as text:
        ring = load_layout("coordination_ring")
        write_trajectories([(ring, [[5, 0], [4, 3]]), (ring, [[0, 0]])], text)
    found = send(watcher, file.read_bytes(), file.name).json()
    assert [len(record["rows"]) for record in found] == [3, 2]


@pytest.mark.parametrize(
    ("data", "name", "words"),
    [
        (b'{"k":"s"}\n', "a.jsonl", "a.jsonl, line 1: a state comes before its episode"),
        (b"[]", "a.json", "a.json: these are not trajectories of overcooked_ai"),
        (b"x", "a.jsonl.gz", "a.jsonl.gz: this .gz file is incomplete"),
        (b"", "a.jsonl", "there is no episode in this file"),
        (b"x", "a.pickle", "ends in .jsonl or .json"),
    ],
)
def test_a_file_that_does_not_fit_is_refused_with_place_and_remedy(
    watcher: Researcher, data: bytes, name: str, words: str
) -> None:
    answer = send(watcher, data, name)
    assert answer.status_code == 422
    assert words in answer.json()["detail"]


def test_a_file_from_another_page_is_refused(watcher: Researcher) -> None:
    assert send(watcher, b"", "a.jsonl", token="made up").status_code == 403
