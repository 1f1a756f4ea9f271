"""Rows 18 to 20 of docs/explanation/faults.md: garbage, floods, and connections that say nothing."""

from pathlib import Path

import pytest

from server import uvicorn_protocols
from tests.support.faults import abuse_scenarios as abuse


def test_the_decoder_takes_anything_without_breaking() -> None:
    abuse.decoder(20_000, seed=18).hold()


async def test_garbage_on_a_socket_harms_nobody_else(tmp_path: Path) -> None:
    (await abuse.frames(tmp_path, tries=400, seed=18)).hold()


@pytest.mark.parametrize(
    "words", [b"", b"GET / HTTP/1.1\r\nHost: 127.0.0.1\r\nX-Slow"], ids=["silent", "half a request"]
)
async def test_connections_without_a_complete_request_are_closed_and_games_are_safe(
    tmp_path: Path, words: bytes, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(uvicorn_protocols, "REQUEST_TIMEOUT_S", 0.5)
    (await abuse.idle_connections(tmp_path, 100, words)).hold()


async def test_silent_connections_make_room_when_there_is_none_left(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(uvicorn_protocols, "most_connections", lambda: 20)
    monkeypatch.setattr(uvicorn_protocols, "REQUEST_TIMEOUT_S", 5.0)
    (await abuse.idle_connections(tmp_path, 100, b"")).hold()


@pytest.mark.slow
def test_a_million_malformed_messages_break_nothing() -> None:
    abuse.decoder(1_000_000, seed=19).hold()


@pytest.mark.slow
async def test_twenty_thousand_malformed_frames_harm_nobody_else(tmp_path: Path) -> None:
    (await abuse.frames(tmp_path, tries=20_000, seed=19)).hold()


@pytest.mark.slow
async def test_a_flood_is_cut_off_and_its_neighbours_do_not_notice(tmp_path: Path) -> None:
    (await abuse.flood(tmp_path, seconds=10)).hold()


@pytest.mark.slow
async def test_five_thousand_silent_connections_cost_nobody_a_game(tmp_path: Path) -> None:
    (await abuse.idle_connections(tmp_path, 5000, b"")).hold()
