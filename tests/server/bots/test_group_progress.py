"""`kitchenmind bots` says how far its participants are, also where its output is a file."""

import argparse
import asyncio
import io
from collections.abc import Callable, Sequence
from types import SimpleNamespace
from typing import Any, cast

import pytest

from server.bots import group as group_module
from server.bots import group_progress
from server.bots.game_client import Journal
from server.bots.group import BotGroup
from server.commands.bots import _simulated


class FakeTerminal(io.StringIO):
    def isatty(self) -> bool:
        return True


def bot(rounds: int, problems: int) -> Any:
    return SimpleNamespace(journal=SimpleNamespace(rounds_played=rounds, violations=["x"] * problems))


async def walk_slowly(
    _group: BotGroup,
    _url: str,
    _database: None,
    told: Callable[[int, int], None],
    meet: Callable[[Sequence[Any]], None],
) -> list[Any]:
    """Two participants, of whom one has finished, until some lines have had their time."""
    meet([bot(3, 0), bot(1, 1)])
    told(1, 2)
    for _ in range(20):
        await asyncio.sleep(0.001)
    return []


def printed(monkeypatch: pytest.MonkeyPatch, out: io.StringIO) -> str:
    monkeypatch.setattr(group_progress, "LINE_EVERY_S", 0.001)
    monkeypatch.setattr(group_progress, "TERMINAL_EVERY_S", 0.001)
    monkeypatch.setattr(group_module, "simulate", walk_slowly)
    monkeypatch.setattr("sys.stderr", out)
    asyncio.run(_simulated(argparse.Namespace(json=False), BotGroup(2, "small"), "", None))
    return out.getvalue()


def test_a_log_gets_plain_lines_with_participants_rounds_and_problems(monkeypatch: pytest.MonkeyPatch) -> None:
    lines = printed(monkeypatch, io.StringIO()).split("\n")
    assert set(lines) == {"1 of 2 participants finished, 4 rounds played, 1 problem", ""}
    assert len(lines) > 2


def test_the_practice_is_not_a_round() -> None:
    games = {name: SimpleNamespace(kind=kind) for name, kind in (("a", "tutorial"), ("b", "episode"), ("c", "episode"))}
    journal = Journal(games=cast(Any, games), ended={"a": {}, "b": {}})
    assert journal.rounds_played == 1


def test_a_terminal_shows_the_progress_in_place(monkeypatch: pytest.MonkeyPatch) -> None:
    shown = printed(monkeypatch, FakeTerminal())
    assert set(shown.rstrip("\n").split("\r")) == {"1 of 2 participants finished, 4 rounds played, 1 problem", ""}
    assert shown.count("\n") == 1
