"""A researcher's pages over real HTTP: access, roles, hidden data, the audit log."""

import dataclasses
import re
import subprocess
import sys
from datetime import UTC, datetime, timedelta
from typing import Any
from xml.etree import ElementTree

import msgspec
import pytest
from msgspec import structs

from overcooked.constants import STAY
from server.monitoring.enrolment_flow import flow_of, stock
from server.play.recorder import EpisodeResult, InputRecord, PauseRecord
from server.store import audit, episodes, inputs, interventions, overview, participants
from server.store.database import DatabaseDown
from server.store.tables import metadata
from server.web.admin import downloads
from tests.support.page_site import PageSite, Visitor
from tests.support.researcher_site import played, signed_in


def test_the_flow_begins_with_the_links_that_were_opened(site: PageSite) -> None:
    visitor = Visitor(site)
    visitor.get("/s/small")
    form = visitor.fields("/consent")
    for kind, reason in (("opened", ""), ("opened", ""), ("opened", ""), ("unsuitable", "screen"), ("declined", "")):
        assert visitor.send("/s/small/arrivals", form | {"kind": kind, "reason": reason}).status_code == 204
    assert visitor.send("/s/small/arrivals", form | {"kind": "hello"}).status_code == 400
    assert visitor.send("/s/small/arrivals", {"kind": "opened"}).status_code == 403
    Visitor(site).consent("small")
    numbers = site.studies.versions("small")
    nodes = flow_of(site.studies.of(site.only("small")), site.database.read_now(stock, overview.Group(numbers)))
    assert [(node["name"], node["reached"], node["lost"]) for node in nodes][:2] == [
        ("Opened the link", 3, {"screen too small": 1, "declined": 1}),
        ("Consented", 1, {}),
    ]
    diagram = signed_in(site, "watch").get("/admin/s/small/consort.svg").text
    assert "Not enrolled (n = 2)" in diagram
    assert ElementTree.fromstring(diagram).tag.endswith("svg")


def test_the_history_counts_people_and_samples_lateness(site: PageSite) -> None:
    for _ in range(3):
        Visitor(site).consent("small")
    first = site.everybody("small")[0].id
    site.database.write_now(participants.complete, first, "KM-1234")
    latencies = site.services.latency_history
    latencies.sample(100.0)
    said = signed_in(site, "watch").get("/admin/s/small/latency.json").json()
    assert (said["people"]["consented"], said["people"]["completed"]) == ([1, 2, 3, 3], [0, 0, 0, 1])
    assert said["machine"] == {"at": [100], "games": [0], "p50_ms": [None], "p99_ms": [None]}


def test_the_table_of_games_shows_proposals_and_exclusions(site: PageSite) -> None:
    episode = played(site, timesteps=60)
    participant = site.only("small")
    result = EpisodeResult(episode, "done", "horizon", 0, 0, 0.0, True, "0" * 16)
    site.database.write_now(episodes.end, result)
    researcher = signed_in(site, "act")
    shown = " ".join(researcher.get("/admin/s/small/games").text.split())
    assert f'data-episode="{episode}" data-pending="yes"' in shown
    said = researcher.get("/admin/s/small/quality.json").json()
    proposal, rules = said["proposals"][episode]
    assert (said["waiting"], proposal) == (0, "drop"), "nobody did anything in it"
    assert "idle" in rules
    researcher.get(f"/admin/s/small/game/{episode}")
    researcher.post(f"/admin/s/small/game/{episode}/exclude", reason="not attentive", note="")
    text = researcher.get(f"/admin/s/small/person/{participant.id}").text
    assert "excluded: not attentive" in text
    assert '<span class="flag bad">drop</span>' in text


def test_a_replay_shows_whether_every_state_is_the_stored_one(site: PageSite) -> None:
    episode = played(site, timesteps=12)
    researcher = signed_in(site, "watch")
    record = researcher.get(f"/admin/s/small/game/{episode}/record.json").json()
    assert record["checked"] == {"states": 13, "equal": True, "difference": None}
    assert [row["t"] for row in record["rows"]] == list(range(13))
    assert record["rows"][5]["actions"] == [STAY, STAY]
    forge = "update ticks set action_0 = 2 where timestep = 7"
    site.database.write_now(lambda connection: connection.exec_driver_sql(forge) and None)
    forged = researcher.get(f"/admin/s/small/game/{episode}/record.json").json()["checked"]
    assert not forged["equal"]
    assert "timestep 7" in forged["difference"]


@pytest.mark.parametrize(("misleading", "words"), [(True, "misleading marks"), (False, "the prediction")])
def test_a_replay_says_whether_the_participant_saw_misleading_marks(
    site: PageSite, misleading: bool, words: str
) -> None:
    episode = played(site)
    loaded = site.database.read_now(episodes.load, episode)
    assert loaded is not None
    changed = dataclasses.replace(loaded.spec, shown="predictor", misleading=misleading)
    values = {"shown": "predictor", "spec": msgspec.to_builtins(changed)}
    site.database.write_now(lambda connection: connection.execute(metadata.tables["episodes"].update().values(values)))
    researcher = signed_in(site, "act")
    page = f"/admin/s/small/game/{episode}"
    assert "participant saw" not in researcher.get(page).text, "blind"
    researcher.post("/admin/blind", blind="off")
    assert f"participant saw: {words}" in " ".join(researcher.get(page).text.split())


def test_a_replay_has_every_input_at_its_timestep_with_what_became_of_it(site: PageSite) -> None:
    episode = played(site)
    began = datetime(2026, 3, 1, tzinfo=UTC)
    site.database.write_now(episodes.pause, PauseRecord(episode, 9, "blur", began, 4000.0))
    one = InputRecord(episode, 0, 1, "tab-0001", 7, 2, 5, 1.5, began.timestamp() * 1000 - 9000, 450.0, 4, "applied")
    late = structs.replace(one, number=2, seq=8, held=None, received_ms=1010.0, timestep=None, outcome="replaced")
    stood = structs.replace(late, number=3, seq=9, received_ms=None, received_unix_ms=began.timestamp() * 1000 + 500)
    site.database.write_now(inputs.insert, [one, late, structs.replace(stood, outcome="stood_still")])
    found = signed_in(site, "own").get(f"/admin/s/small/game/{episode}/record.json").json()["inputs"]
    assert [(row["seq"], row["t"], row["held"], row["tap"], row["outcome"]) for row in found] == [
        (7, 3, 2, 5, "applied"),
        (8, 5, None, 5, "replaced"),
        (9, 9, None, 5, "stood_still"),
    ]


def test_a_replay_knows_whose_absence_a_pause_was(site: PageSite) -> None:
    episode = played(site)
    began = datetime(2026, 3, 1, tzinfo=UTC)
    for minute, (reason, seat) in enumerate((("blur", 1), ("researcher", None))):
        record = PauseRecord(episode, 5, reason, began + timedelta(minutes=minute), 4000.0, seat=seat)
        site.database.write_now(episodes.pause, record)
    found = signed_in(site, "own").get(f"/admin/s/small/game/{episode}/record.json").json()["pauses"]
    assert found == [
        {"t": 5, "reason": "blur", "duration_ms": 4000.0, "seat": 1},
        {"t": 5, "reason": "researcher", "duration_ms": 4000.0, "seat": None},
    ]


def test_the_accuracy_of_a_replay_counts_what_was_done_in_the_timestep_predicted(site: PageSite) -> None:
    episode = played(site, timesteps=12)
    researcher = signed_in(site, "act")
    researcher.get("/admin")
    researcher.post("/admin/blind", blind="off")
    steps = researcher.get(f"/admin/s/small/game/{episode}/record.json").json()["accuracy"]
    assert [(step["share"], step["n"]) for step in steps] == [(1.0, 12), (0.0, 11), (1.0, 10)]


def test_a_paused_study_lets_nobody_in_until_it_is_resumed(site: PageSite) -> None:
    waiting = Visitor(site)
    boxes = dict.fromkeys(re.findall(r'name="(box_\d+)"', waiting.get("/s/small").text), "yes")
    form = waiting.fields("/consent") | boxes
    researcher = signed_in(site, "act")
    researcher.get("/admin/s/small")
    assert "is paused" in researcher.post("/admin/s/small/pause", note="the room is dark").text
    assert waiting.send("/s/small/consent", form).status_code == 503, "the consent page has to wait too"
    newcomer = Visitor(site).get("/s/small?lang=en&PROLIFIC_PID=5f1e00000000000000000001")
    assert newcomer.status_code == 503
    assert "paused this study for a while" in newcomer.text
    assert "PROLIFIC_PID=5f1e00000000000000000001" in newcomer.text, "the link stays whole"
    assert site.everybody("small") == []
    researcher.get("/admin/s/small")
    researcher.post("/admin/s/small/resume", note="light again")
    assert Visitor(site).consent("small").status_code == 200
    noted = site.database.read_now(audit.entries)
    assert [entry.action for entry in noted] == ["sign in", "pause study", "resume study"]
    assert noted[1].actor == "act"
    assert noted[1].detail == {"study": "small", "reason": "the room is dark", "done": True}


def test_what_the_audit_log_cannot_record_is_not_done(site: PageSite, monkeypatch: pytest.MonkeyPatch) -> None:
    Visitor(site).consent("small")
    person = site.only("small").id
    researcher = signed_in(site, "act")
    researcher.get("/admin/s/small")
    token = researcher.token()

    def down(*_: object) -> None:
        raise DatabaseDown("away")

    monkeypatch.setattr(audit, "add", down)
    for path in ("/admin/s/small/pause", f"/admin/s/small/person/{person}/release", "/admin/blind"):
        assert researcher.client.post(path, data={"form_token": token, "note": "x", "blind": "off"}).status_code == 503
    assert site.database.read_now(interventions.paused_studies) == set()
    assert site.only("small").status == "active"
    monkeypatch.undo()
    assert "hidden" in researcher.get(f"/admin/s/small/person/{person}").text, "still in blind mode"


def test_an_exclusion_needs_a_reason_is_audited_and_can_be_taken_back(site: PageSite) -> None:
    episode = played(site)
    person = site.only("small").id
    researcher = signed_in(site, "act")
    game, page = f"/admin/s/small/game/{episode}", f"/admin/s/small/person/{person}"
    researcher.get(game)
    assert researcher.post(f"{game}/exclude", reason="because").status_code == 400
    researcher.get(game)
    assert "are excluded" in researcher.post(f"{game}/exclude", reason="not attentive", note="phone", next=game).text
    (held,) = site.database.read_now(interventions.exclusions_of, [person])
    assert (held.episode_id, held.reason, held.note) == (episode, "not attentive", "phone")
    assert "not attentive" in researcher.get(page).text
    researcher.post(f"{page}/restore", exclusion=str(held.id), next=page)
    assert site.database.read_now(interventions.exclusions_of, [person]) == []
    actions_noted = [entry.action for entry in site.database.read_now(audit.entries)]
    assert actions_noted == ["sign in", "exclude game", "restore participant"]
    assert site.database.read_now(audit.first_forged) is None


def test_a_freed_place_is_given_to_the_next(site: PageSite) -> None:
    played(site)
    participant = site.only("small")
    researcher = signed_in(site, "act")
    page = f"/admin/s/small/person/{participant.id}"
    researcher.get(page)
    assert "free again" in researcher.post(f"{page}/release", note="left the room", next=page).text
    assert site.only("small").status == "returned"
    assert "already ended" in researcher.post(f"{page}/release", note="again", next=page).text


def test_only_who_still_takes_part_gets_more_time(site: PageSite) -> None:
    Visitor(site).consent("small")
    person = site.only("small")
    researcher, other = signed_in(site, "act"), signed_in(site, "act")
    page = f"/admin/s/small/person/{person.id}"
    researcher.get(page), other.get(page)
    assert "The place is not held, though" in other.post(f"{page}/extend", note="a call", next=page).text
    site.database.write_now(participants.advance, person.id, 0, 1)
    assert "more time now.</p>" in other.post(f"{page}/extend", note="a call", next=page).text
    researcher.post(f"{page}/release", note="they went home", next=page)
    assert "already ended" in other.post(f"{page}/extend", note="a call", next=page).text


def test_an_export_is_refused_in_blind_mode_and_else_is_the_command_s(site: PageSite) -> None:
    import io
    import zipfile

    played(site)
    researcher = signed_in(site, "act")
    page = researcher.get("/admin/s/small").text
    assert page.count('aria-disabled="true"\n  aria-describedby="blind-note"') == 2
    assert "Turn blind mode off to use them.</p>" in page
    assert researcher.post("/admin/s/small/export").status_code == 409
    researcher.get("/admin/s/small")
    researcher.post("/admin/blind", blind="off", next="/admin/s/small")
    assert "blind-note" not in researcher.get("/admin/s/small").text
    archive = researcher.post("/admin/s/small/export")
    assert archive.headers["content-type"] == "application/zip"
    names = zipfile.ZipFile(io.BytesIO(archive.content)).namelist()
    assert any(name.endswith("dataset_description.json") for name in names)
    assert "export" in [entry.action for entry in site.database.read_now(audit.entries)]


def test_an_account_that_another_owner_has_removed_is_not_removed_again(site: PageSite) -> None:
    first, second = signed_in(site, "own"), signed_in(site, "own")
    first.get("/admin/accounts"), second.get("/admin/accounts")
    assert "The account is removed." in first.post("/admin/accounts/watch/removed").text
    assert "there is no such account any more" in second.post("/admin/accounts/watch/removed").text
    assert "there is no such account any more" in second.post(f"/admin/accounts/{'x' * 5000}/signed_out").text
    actions = [entry.action for entry in site.database.read_now(audit.entries)]
    assert actions.count("account removed") == 1
    assert "account signed_out" not in actions


def test_an_export_that_takes_too_long_is_given_up_with_the_remedy(
    site: PageSite, monkeypatch: pytest.MonkeyPatch
) -> None:
    started: list[subprocess.Popen[bytes]] = []

    def sleeping(*_: str, **__: Any) -> subprocess.Popen[bytes]:
        started.append(subprocess.Popen([sys.executable, "-c", "import time; time.sleep(600)"], stdout=subprocess.PIPE))
        return started[-1]

    monkeypatch.setattr(downloads, "start_module", sleeping)
    monkeypatch.setattr(downloads, "TIMEOUT_S", 0.05)
    researcher = signed_in(site, "act")
    researcher.get("/admin/s/small")
    researcher.post("/admin/blind", blind="off", next="/admin/s/small")
    refused = researcher.post("/admin/s/small/export")
    assert (refused.status_code, refused.headers["retry-after"]) == (503, "600")
    assert "Run `kitchenmind export` on the server, or try again later." in refused.text
    assert started[0].wait(10) != 0, "its process has ended"


def test_researchers_get_errors_in_their_own_pages(site: PageSite) -> None:
    researcher = signed_in(site, "own")
    missing = researcher.get("/admin/s/nowhere")
    reason = "There is no study &#39;nowhere&#39;. Open it from the list of studies."
    assert (missing.status_code, missing.text.count(reason)) == (404, 1)
    assert '<link rel="stylesheet" href="/static/css/admin.css">' in missing.text
    assert "Check the address." in researcher.get("/admin/no-such-page").text
    no_game = researcher.get("/admin/s/small/game/none").text
    assert "<p>This study has no such game. Open it from the list of games.</p>" in no_game
    assert "admin.css" not in researcher.get("/administer").text
    program = researcher.client.get("/admin/s/nowhere", headers={"accept": "application/json"})
    assert program.json() == {"detail": "There is no study 'nowhere'. Open it from the list of studies."}
