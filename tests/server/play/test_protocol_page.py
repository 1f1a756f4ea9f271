"""docs/reference/protocol.md describes every message, and its examples are messages."""

import ast
import re
from pathlib import Path
from typing import get_args

import msgspec
import pytest

from server.play import messages, protocol_tables
from server.play.close_codes import CAUSES, CloseCode
from server.play.pause_reasons import NOT_STARTED
from server.play.recorder import PAUSE_REASONS
from server.play.token_bucket import BURST, PER_S
from server.play.tutorial import LESSONS
from server.web import forms, rate_limits
from server.web.participant import game_socket, socket_input, study_pages, watch_agents

PAGE = (Path(__file__).parents[3] / "docs" / "reference" / "protocol.md").read_text(encoding="utf-8")
FROM_BROWSER, FROM_SERVER = PAGE.split("## From the server")
EXAMPLES = re.findall(r"```json\n(.*?)```", PAGE, re.DOTALL)


def names(union: object) -> set[str]:
    return {kind.__struct_config__.tag for kind in union.__args__}  # type: ignore[attr-defined]


def headings(text: str) -> set[str]:
    return set(re.findall(r"^### (\w+)$", text, re.MULTILINE))


def test_every_message_has_its_section_and_there_is_no_other() -> None:
    assert headings(FROM_BROWSER) == names(messages.Incoming)
    assert headings(FROM_SERVER) == names(messages.Outgoing)


def test_every_field_is_in_its_example() -> None:
    shown = {msgspec.json.decode(example)["type"]: set(msgspec.json.decode(example)) for example in EXAMPLES}
    for union in (messages.Incoming, messages.Outgoing):
        for kind in union.__args__:
            assert shown[kind.__struct_config__.tag] == {"type", *kind.__struct_fields__}, kind


@pytest.mark.parametrize("example", EXAMPLES, ids=lambda example: msgspec.json.decode(example)["type"])
def test_the_example_decodes_to_the_documented_message(example: str) -> None:
    kinds = messages.Incoming if msgspec.json.decode(example)["type"] in names(messages.Incoming) else messages.Outgoing
    message = msgspec.json.decode(example, type=kinds)
    assert msgspec.json.decode(msgspec.json.encode(message)) == msgspec.json.decode(example)


def test_every_reason_code_and_lesson_is_named() -> None:
    assert set(get_args(messages.PauseReason)) == {*PAUSE_REASONS, "partner"} - {NOT_STARTED}
    for reason in (*get_args(messages.PauseReason), *get_args(messages.EndReason)):
        assert f"`{reason}`" in PAGE, reason
    for lesson in LESSONS:
        assert f"`{lesson}`" in PAGE, lesson


SERVER = Path(__file__).parents[3] / "server"
CALLS = [
    node
    for path in (
        "web/participant/game_socket.py",
        "web/participant/socket_input.py",
        "participation/waiting_room.py",
        "play/game.py",
        "play/games.py",
        "play/send_queue.py",
        "uvicorn_protocols.py",
    )
    for node in ast.walk(ast.parse((SERVER / path).read_text(encoding="utf-8")))
    if isinstance(node, ast.Call)
]


def called(name: str, place: int) -> set[str]:
    """The texts that the server gives to a function in this place; of a formatted text the part before the value."""
    given = [call.args[place] for call in CALLS if ast.unparse(call.func).split(".")[-1] == name and call.args[place:]]
    plain = {text.value for text in given if isinstance(text, ast.Constant) and isinstance(text.value, str)}
    return plain | {ast.literal_eval(text.values[0]) for text in given if isinstance(text, ast.JoinedStr)}


def test_every_code_of_a_refusal_is_named() -> None:
    assert called("Refused", 0) <= set(get_args(messages.RefusalCode))
    for code in get_args(messages.RefusalCode):
        assert f"| `{code}` |" in PAGE, code


def test_every_code_and_reason_of_a_close_is_named() -> None:
    described = {int(code) for code in re.findall(r"^\| ([14]\d{3}) \|", PAGE, re.MULTILINE)}
    assert described == {*CloseCode, 1002} - {CloseCode.LOST}, "1002: sent by the websocket library alone"
    reasons = (called("close", 1) | called("send_close", 1)) - {""}
    assert {"too many connections", "no answer to a ping", "too far behind"} <= reasons
    for reason in reasons:
        assert f"`{reason}" in PAGE, reason


def test_causes_and_reactions_of_a_close_are_those_of_the_code() -> None:
    rows = re.findall(r"^\| ([14]\d{3}) \| (.*?) \| .*? \| (.*?) \|$", PAGE, re.MULTILINE)
    described = {int(code): (cause, reaction) for code, cause, reaction in rows}
    assert set(CAUSES) == set(CloseCode)
    for code in set(CloseCode) - {CloseCode.LOST}:  # a lost connection has no code, and no row
        assert described[code] == CAUSES[code]


def test_tables_of_fields_are_those_of_the_types() -> None:
    names_there = re.findall(r"<!-- fields: (\w+) -->", PAGE)
    assert sorted(names_there) == sorted(protocol_tables.structs())
    again = "Write them: python -m server.play.protocol_tables"
    assert protocol_tables.render(PAGE) == PAGE, again


def test_limits_are_those_of_the_code() -> None:
    assert f"{messages.MAX_FRAME_BYTES} bytes" in PAGE
    assert f"{PER_S:g} messages a second" in PAGE
    assert f"{BURST:g} at once" in PAGE
    assert f"At most {game_socket.MAX_OF_ONE} sockets of one participant" in PAGE
    assert f"after {socket_input.MAX_REFUSED} of them" in PAGE
    echoes = f"first {study_pages.ECHOED_CHARACTERS} characters of each text frame"
    assert echoes in PAGE
    assert f"After {study_pages.MAX_ECHOES} frames or {study_pages.CHECK_S} seconds" in PAGE
    assert f"At most {watch_agents.MAX_GAMES} such games" in PAGE
    assert f"{forms.MAX_FORM_BYTES // 1024} KiB and {forms.MAX_FIELDS} fields" in PAGE
    assert f"may ask {rate_limits.PER_S:g} times a second" in PAGE


def test_every_route_of_a_participant_is_described() -> None:
    described = PAGE.split("## Before and after a game")[1]
    assert "`/protocol.json`" in PAGE
    for path in ("", "/consent", "/now", "/language", "/withdraw"):
        assert f"/s/{{study}}{path}`" in described, path
    assert "`/watch/socket`" in PAGE
