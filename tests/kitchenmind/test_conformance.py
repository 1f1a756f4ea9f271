"""`kitchenmind conformance`: a real server passes every check, and one that misbehaves in one point fails that one."""

import asyncio
import json
import re
from collections.abc import Callable, Iterator
from pathlib import Path

import msgspec
import pytest

from kitchenmind.client.conformance import Conformance
from server.play import messages
from server.play.game import Game
from server.play.session import Session
from server.web import protocol_document
from server.web.participant import socket_input
from tests.support import command_line
from tests.support.guide_machine import free_port
from tests.support.live_server import LiveServer


@pytest.fixture(scope="module")
def live(tmp_path_factory: pytest.TempPathFactory) -> Iterator[LiveServer]:
    with LiveServer(tmp_path_factory.mktemp("served"), speed=5.0) as serving:
        yield serving


def test_a_server_passes_every_check(live: LiveServer) -> None:
    done = command_line.run("conformance", live.url)
    assert "FAILED" not in done.stdout, done.stdout
    assert done.stdout.splitlines()[-1] == "16 of 16 checks passed"
    assert done.returncode == 0, done.stderr


def test_a_server_behind_a_path_leads_to_its_consent_page_there(tmp_path: Path) -> None:
    port = free_port()
    with LiveServer(tmp_path, speed=5.0, port=port, public_url=f"http://127.0.0.1:{port}/kitchen"):
        check = Conformance(f"http://127.0.0.1:{port}/kitchen", "short").no_step_without_consent
        asyncio.run(check())


def forgets_the_schema(patch: pytest.MonkeyPatch) -> None:
    patch.setattr(protocol_document, "protocol_json", lambda: b'{"x-protocol": 0}')


def lets_unknown_fields_pass(patch: pytest.MonkeyPatch) -> None:
    decode = messages.decode

    def decode_leniently(frame: str) -> messages.Incoming:
        return decode(frame.replace(', "more": 1', ""))

    patch.setattr(messages, "decode", decode_leniently)


def takes_long_frames(patch: pytest.MonkeyPatch) -> None:
    let_in = socket_input.Gate.let_in
    patch.setattr(socket_input.Gate, "let_in", lambda self, text, *more: let_in(self, text and text[:1000], *more))


def tells_wrong_actions(patch: pytest.MonkeyPatch) -> None:
    tick_message = Session.tick_message

    def lying(self: Session, person: int) -> messages.Tick:
        tick = tick_message(self, person)
        x, *others = tick.state.players[0]
        shifted = ((x, others[0], (others[1] + 1) % 4, others[2]), tick.state.players[1])
        wrong = msgspec.structs.replace(tick.state, players=shifted) if tick.state.t % 2 else tick.state
        return msgspec.structs.replace(tick, state=wrong)

    patch.setattr(Session, "tick_message", lying)


def never_applies_inputs(patch: pytest.MonkeyPatch) -> None:
    patch.setattr(Session, "key", lambda self, *arguments, **named: False)


def says_nothing_to_the_old_tab(patch: pytest.MonkeyPatch) -> None:
    patch.setattr(Game, "_dismiss", staticmethod(lambda connection: None))


@pytest.mark.parametrize(
    ("misbehave", "check", "reason"),
    [
        (forgets_the_schema, "schema_is_served", "x-protocol is 0"),
        (lets_unknown_fields_pass, "wrong_messages_change_nothing", "no refused within|not_now"),
        (takes_long_frames, "long_frames_close_the_socket", "did not close"),
        (tells_wrong_actions, "states_follow_the_rules", "does not follow from"),
        (never_applies_inputs, "inputs_are_applied", "was not applied"),
        (says_nothing_to_the_old_tab, "newest_tab_plays", "no superseded within"),
    ],
)
async def test_a_server_that_misbehaves_in_one_point_fails_there(
    live: LiveServer,
    monkeypatch: pytest.MonkeyPatch,
    misbehave: Callable[[pytest.MonkeyPatch], None],
    check: str,
    reason: str,
) -> None:
    misbehave(monkeypatch)
    found = await Conformance(live.url, "short", within_s=6.0).run()
    failed = {finding.name: finding.reason for finding in found if not finding.passed}
    name = " ".join((getattr(Conformance, check).__doc__ or "").split())
    assert set(failed) == {name}
    assert re.search(reason, failed[name])


def test_wrong_input_exits_with_2_and_the_remedy(live: LiveServer) -> None:
    done = command_line.run("conformance", "localhost:8000")
    assert done.returncode == 2
    assert "is not an address" in done.stderr
    for named in ([], ["--study", "quick_look"]):
        done = command_line.run("conformance", "http://127.0.0.1:9", *named)
        assert done.returncode == 2
        assert "there is no server at http://127.0.0.1:9" in done.stderr


def test_findings_as_json_and_an_unknown_study_fails_its_checks(live: LiveServer) -> None:
    done = command_line.run("conformance", live.url, "--study", "nowhere", "--json")
    assert done.returncode == 1
    found = {finding["name"]: finding for finding in json.loads(done.stdout)}
    assert len(found) == 16
    assert found["consent sets a cookie, and the pages lead to a game"]["reason"].endswith("answered 404")
    assert found["/protocol.json has the messages of this protocol"]["passed"]
