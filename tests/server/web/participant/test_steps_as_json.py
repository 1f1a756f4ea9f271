"""A participant's steps as JSON match the pages: same fields, same checks, same end."""

import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import httpx
import jsonschema_rs
import pytest

from kitchenmind.client.pages import ParsedPage, filled_in, page_of_json
from server.play.protocol_schema import protocol_schema
from tests.support.page_site import SMALL_STUDY, PageSite

JSON = {"accept": "application/json"}
HTML = {"accept": "text/html"}
ANSWERS: dict[str, Any] = {
    "mood": 4, "check": 2, "pick": "tea", "many": ["a", "c"], "words": "=1+1", "years": 30,
    "rank": {"x": 3, "y": 1, "z": 2},
}  # fmt: skip


@pytest.fixture
def site(tmp_path: Path) -> Iterator[PageSite]:
    with PageSite(tmp_path, SMALL_STUDY) as running:
        yield running


class Program:
    """Takes part by JSON alone; checks each page against the served schema and against the HTML of the same step."""

    def __init__(self, site: PageSite) -> None:
        self.http = httpx.Client(base_url=site.url, headers=JSON, follow_redirects=True, timeout=60)
        site.clients.append(self.http)
        schema = protocol_schema() | {"anyOf": [{"$ref": "#/$defs/StepPage"}]}
        self.schema = jsonschema_rs.Draft202012Validator(schema)
        self.page: dict[str, Any] = {}
        self.tried: dict[str, int] = {}

    def get(self, path: str) -> dict[str, Any]:
        return self._took(self.http.get(path))

    def post(self, **values: Any) -> dict[str, Any]:
        """Send the page's form with its hidden fields and these values, as JSON."""
        form = self.page["form"]
        hidden = {one["name"]: one["value"] for one in form["fields"] if one["type"] == "hidden"}
        return self._took(self.http.post(form["action"], json=hidden | values))

    def _took(self, response: httpx.Response) -> dict[str, Any]:
        assert response.headers["content-type"] == "application/json", response.text
        assert response.headers["vary"] == "Accept"
        self.page = response.json()
        assert self.schema.is_valid(self.page), self.page
        return self.page

    def answers(self) -> dict[str, Any]:
        """An answer to every question; in the quiz each option in turn until the next page comes."""
        given: dict[str, Any] = {}
        for one in self.page["form"]["fields"]:
            if one["type"] in ("choice", "multiple"):
                values = [option["value"] for option in one["options"]]
                self.tried[one["name"]] = self.tried.get(one["name"], -1) + (self.page["page"] == "quiz")
                given[one["name"]] = values[self.tried[one["name"]] % len(values)]
            elif one["type"] in ("scale", "number"):
                given[one["name"]] = one["low"]
            elif one["type"] == "ranking":
                given[one["name"]] = {option["value"]: place for place, option in enumerate(one["options"], start=1)}
            elif one["type"] == "text":
                given[one["name"]] = "words"
        return given

    def same_as_html(self) -> None:
        """The form of this step has the inputs that people see."""
        path = self.page["form"]["action"]
        seen = ParsedPage(self.http.get("/s/small/now", headers=HTML).text).form(path) or {}
        told = page_of_json(json.dumps(self.page)).form(path) or {}
        assert {name: len(one) for name, one in told.items()} == {
            name: len(one) for name, one in seen.items() if one[0].kind != "button"
        }
        for name, inputs in told.items():
            if name != "form_token" and inputs[0].kind != "select":
                assert [one.value for one in inputs] == [one.value for one in seen[name]]
        left_out = {"form_token"}
        plain = {key: value for key, value in filled_in(told, {}).items() if key not in left_out}
        assert plain == {key: value for key, value in filled_in(seen, {}).items() if key not in left_out}


def test_a_program_completes_a_study_by_json(site: PageSite) -> None:
    program = Program(site)
    assert program.get("/")["studies"][0]["path"] == "/s/small"
    assert program.get("/s/small")["page"] == "consent"
    boxes = {one["name"]: True for one in program.page["form"]["fields"] if one["type"] == "check"}
    assert boxes
    again = program.post()
    assert [bool(one.get("fault")) for one in again["form"]["fields"] if one["type"] == "check"] == [True] * len(boxes)
    program.post(**boxes)
    kinds = []
    while "end" not in program.page:
        kinds.append(program.page["page"])
        assert len(kinds) < 60
        if program.page["page"] == "game":
            assert program.page["game"]["socket"] == "/s/small/socket"
            site.end_game(site.only("small"))
            program.get("/s/small/now")
            continue
        program.same_as_html()
        answers = program.answers()
        program.post(**answers | {name: value for name, value in ANSWERS.items() if name in answers})
    assert {"introduction", "questionnaire", "ready", "game"} <= set(kinds)
    assert program.page["page"] == "thanks"
    assert program.page["end"]["kind"] == "completed"
    assert program.page["end"]["own_code"] == site.only("small").completion_code


def test_wrong_answers_are_returned_with_the_reason(site: PageSite) -> None:
    program = at_questions(site)
    missing = program.post()
    assert (missing["page"], missing["step"]) == ("questionnaire", program.page["step"])
    faults = {one["name"]: one["fault"] for one in missing["form"]["fields"] if one.get("fault")}
    assert faults
    assert all(faults.values())


def at_questions(site: PageSite) -> Program:
    program = Program(site)
    program.get("/s/small")
    program.post(**{one["name"]: True for one in program.page["form"]["fields"] if one["type"] == "check"})
    while program.page["page"] != "questionnaire":
        if program.page["page"] == "game":
            site.end_game(site.only("small"))
            program.get("/s/small/now")
        else:
            program.post(**program.answers())
    return program


@pytest.mark.parametrize(
    ("headers", "change"),
    [
        ({"origin": "https://elsewhere.example.org"}, {}),
        ({"sec-fetch-site": "cross-site"}, {}),
        ({}, {"form_token": ""}),
        ({}, {"form_token": "made.up.token"}),
    ],
)
def test_a_json_form_needs_our_origin_and_its_token(
    site: PageSite, headers: dict[str, str], change: dict[str, str]
) -> None:
    program = Program(site)
    page = program.get("/s/small")
    fields = {one["name"]: one["value"] or True for one in page["form"]["fields"] if one["type"] in ("hidden", "check")}
    refused = program.http.post(page["form"]["action"], json=fields | change, headers=headers)
    assert refused.status_code == 403
    assert site.everybody("small") == []


@pytest.mark.parametrize(
    "body",
    [b"", b"[]", b'"words"', b"{", b"\xff{}", b'{"a": {"b": {"c": 1}}}', b'{"a": [[1]]}', b'{"a": NaN}'],
    ids=str,
)
def test_a_body_that_is_not_a_form_is_refused_with_its_reason(site: PageSite, body: bytes) -> None:
    program = Program(site)
    refused = program.http.post("/s/small/consent", content=body, headers={"content-type": "application/json"})
    assert refused.status_code == 400
    assert refused.json()["detail"]


def test_browsers_and_plain_clients_get_pages(site: PageSite) -> None:
    for accept in ("text/html,application/xhtml+xml,*/*;q=0.8", "*/*", "application/json, text/html"):
        page = httpx.get(f"{site.url}/s/small", headers={"accept": accept})
        assert page.headers["content-type"].startswith("text/html")
