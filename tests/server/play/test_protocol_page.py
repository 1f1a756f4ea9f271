"""docs/protocol.md describes every message, and its examples are messages."""

import re
from pathlib import Path

import msgspec
import pytest

from server.play import messages
from server.play.holds import NOT_STARTED
from server.play.recorder import PAUSE_REASONS
from server.play.tutorial import LESSONS

PAGE = (Path(__file__).parents[3] / "docs" / "protocol.md").read_text(encoding="utf-8")
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
def test_example_decodes_to_what_it_says(example: str) -> None:
    kinds = messages.Incoming if msgspec.json.decode(example)["type"] in names(messages.Incoming) else messages.Outgoing
    message = msgspec.json.decode(example, type=kinds)
    assert msgspec.json.decode(msgspec.json.encode(message)) == msgspec.json.decode(example)


def test_every_reason_code_and_lesson_is_named() -> None:
    for reason in {*PAUSE_REASONS, "partner"} - {NOT_STARTED}:
        assert f"`{reason}`" in PAGE, reason
    for lesson in LESSONS:
        assert f"`{lesson}`" in PAGE, lesson


def test_every_code_of_a_refusal_and_of_a_close_is_named() -> None:
    sources = [
        Path(__file__).parents[3] / "server" / path for path in ("web/socket.py", "play/game.py", "play/games.py")
    ]
    text = "".join(source.read_text(encoding="utf-8") for source in sources)
    refusals = set(re.findall(r'Refused\("(\w+)"', text))
    closes = set(re.findall(r"^[A-Z_]+(?:: Final)? = (1\d{3}|4\d{3})\b", text, re.MULTILINE))
    assert refusals
    assert {"1008", "4001", "4004"} <= closes
    for code in refusals:
        assert f"`{code}`" in PAGE, code
    for code in closes:
        assert f"| {code} |" in PAGE, code


def test_limits_are_those_of_the_code() -> None:
    assert str(messages.MAX_FRAME_BYTES) in PAGE
    assert "20 messages a second" in PAGE
