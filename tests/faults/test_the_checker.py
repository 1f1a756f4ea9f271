"""The checker of the invariants finds violations: a real game is played, then its record is tampered with."""

import asyncio
from collections.abc import Callable
from pathlib import Path

import pytest
from sqlalchemy import delete, insert, select, text, update

from server.store.database import Database
from server.store.tables import participants, ticks
from tests.support.faults.group import LONG_STUDY, ClientGroup
from tests.support.faults.invariants import Findings, held_against, lateness_ms, untrue
from tests.support.faults.recording_client import ClientLog, LogEntry, RecordingClient
from tests.support.live_server import LiveServer


@pytest.fixture(scope="module")
def played(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, list[RecordingClient]]:
    """The database of a short game, and who played it."""
    folder = tmp_path_factory.mktemp("checker")

    async def play() -> list[RecordingClient]:
        with LiveServer(folder, study=LONG_STUDY, speed=10.0) as live:
            async with ClientGroup(live.url, 1, idle=0.2) as group:
                await asyncio.sleep(1.0)
        return group.clients

    return folder / "study.sqlite3", asyncio.run(play())


def tampered(played: tuple[Path, list[RecordingClient]], tmp_path: Path, change: Callable[..., object]) -> Findings:
    """What is found in a copy of the database after a change."""
    copy = tmp_path / "copy.sqlite3"
    copy.write_bytes(played[0].read_bytes())
    with Database(f"sqlite:///{copy}") as database:
        database.write_now(change)
    return held_against(f"sqlite:///{copy}", played[1])


def test_an_unchanged_record_passes(played: tuple[Path, list[RecordingClient]], tmp_path: Path) -> None:
    found = tampered(played, tmp_path, lambda connection: connection.execute(text("SELECT 1")).scalar_one())
    assert found.ok
    assert found.compared > 5


def test_a_lost_timestep_is_found(played: tuple[Path, list[RecordingClient]], tmp_path: Path) -> None:
    found = tampered(played, tmp_path, lambda c: c.execute(delete(ticks).where(ticks.c.timestep == 3)).rowcount)
    assert (bool(found.lost), bool(found.holes)) == (True, True)


def test_another_state_in_a_timestep_is_found(played: tuple[Path, list[RecordingClient]], tmp_path: Path) -> None:
    change = update(ticks).where(ticks.c.timestep == 3).values(state_hash=bytes(8))
    found = tampered(played, tmp_path, lambda c: c.execute(change).rowcount)
    assert len(found.mismatches) >= 2, "what was seen, and what comes of playing it again"


def test_a_key_that_moved_twice_or_that_nobody_pressed_is_found(
    played: tuple[Path, list[RecordingClient]], tmp_path: Path
) -> None:
    query = select(ticks.c.key_seq_0).where(ticks.c.key_seq_0.is_not(None)).limit(1)

    def twice(connection: object) -> object:
        seq = connection.execute(query).scalar_one()  # type: ignore[attr-defined]
        return connection.execute(update(ticks).where(ticks.c.timestep > 2).values(key_seq_0=seq)).rowcount  # type: ignore[attr-defined]

    assert tampered(played, tmp_path, twice).doubled


def test_a_person_who_is_there_twice_is_found(played: tuple[Path, list[RecordingClient]], tmp_path: Path) -> None:
    def again(connection: object) -> object:
        row = dict(connection.execute(select(participants)).one()._mapping)  # type: ignore[attr-defined]
        other = row | {"id": "another", "token_hash": "another", "number": 99}
        return connection.execute(insert(participants).values(other)).rowcount  # type: ignore[attr-defined]

    assert tampered(played, tmp_path, again).people


def client_log(*told: tuple[float, str, object]) -> ClientLog:
    return ClientLog(entries=[LogEntry(at, kind, detail, 1) for at, kind, detail in told])


def test_correct_messages_are_not_reported() -> None:
    honest = client_log((0, "welcome", 0), (1, "countdown", None), (1, "tick", 0), (4, "tick", 1), (4.2, "tick", 2))
    paused = client_log(
        (0, "welcome", 5), (0, "paused", "lost"), (9, "countdown", None), (9, "tick", 5), (12, "tick", 6)
    )
    assert untrue(honest) == untrue(paused) == []


def test_a_game_that_moves_while_reported_as_paused_is_found() -> None:
    assert untrue(
        client_log((0, "welcome", 0), (1, "countdown", None), (4, "tick", 1), (5, "paused", "database"), (6, "tick", 2))
    )


def test_a_game_that_stops_without_a_message_is_found() -> None:
    assert untrue(client_log((0, "welcome", 0), (1, "countdown", None), (4, "tick", 1), (9, "tick", 2)))


def test_lateness_of_a_period_counts_the_timesteps_made_in_it(
    played: tuple[Path, list[RecordingClient]],
) -> None:
    url = f"sqlite:///{played[0]}"
    with Database(url, read_only=True) as database:
        made = sorted(database.read_now(lambda c: c.execute(select(ticks.c.made_unix_ms, ticks.c.late_ms)).all()))
    middle = made[len(made) // 2].made_unix_ms
    assert sorted(lateness_ms(url, since_ms=middle)) == sorted(row.late_ms for row in made if row[0] >= middle)
    assert len(lateness_ms(url)) == len(made)
