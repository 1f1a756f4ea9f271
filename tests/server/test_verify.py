from collections.abc import Callable
from pathlib import Path

import pytest
from sqlalchemy import Connection, create_engine, delete, select, update

import kitchenmind
from server.store import audit
from server.store.database import Database
from server.store.tables import audit as audit_table
from server.store.tables import episodes, ticks


@pytest.fixture
def filled(url: str) -> str:
    """A database with a played study; see `url` of conftest.py."""
    return url


def verify(url: str, *more: str) -> int:
    return kitchenmind.main(["verify", "--database", url, *more])


def first_episode(connection: Connection) -> str:
    query = select(episodes.c.id).order_by(episodes.c.created_at, episodes.c.id)
    return connection.execute(query).scalars().first() or ""


def test_every_stored_episode_is_simulated_to_the_same_states(filled: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert verify(filled) == 0
    assert capsys.readouterr().out.splitlines()[1].split() == ["coordination_ring", "6", "240", "0"]
    assert verify(filled, "--study", "ring") == 0


def test_an_audit_log_without_its_last_entry_is_reported(filled: str, capsys: pytest.CaptureFixture[str]) -> None:
    with Database(filled) as database:
        for _ in range(2):
            database.write_now(audit.add, "ada", "pause", {"study": "ring"})
    assert verify(filled) == 0
    assert "The audit log is complete." in capsys.readouterr().out
    with Database(filled) as database:
        database.write_now(remove_last_entry)
    assert verify(filled) == 1
    assert "The audit log was changed: entry 2 is missing or is not what was written." in capsys.readouterr().out


def remove_last_entry(connection: Connection) -> None:
    """Remove the last entry like somebody who can write to the database and drops its triggers."""
    if connection.dialect.name == "sqlite":
        connection.exec_driver_sql("DROP TRIGGER audit_keeps_entries")
    else:
        connection.exec_driver_sql("ALTER TABLE audit DISABLE TRIGGER USER")
    connection.execute(delete(audit_table).where(audit_table.c.id == 2))


def test_running_episode_is_checked_as_far_as_it_was_played(filled: str) -> None:
    def reopen(connection: Connection) -> None:
        unended = dict.fromkeys(("score", "soups", "progress", "final_hash", "ended_at"), None)
        connection.execute(update(episodes).values(status="running", **unended))
        connection.execute(delete(ticks).where(ticks.c.timestep > 20))

    with Database(filled) as database:
        database.write_now(reopen)
    assert verify(filled) == 0


def change_tick(**values: object) -> Callable[[Connection], None]:
    def change(connection: Connection) -> None:
        here = (ticks.c.episode_id == first_episode(connection), ticks.c.timestep == 17)
        connection.execute(update(ticks).where(*here).values(**values))

    return change


def change_episode(**values: object) -> Callable[[Connection], None]:
    def change(connection: Connection) -> None:
        connection.execute(update(episodes).where(episodes.c.id == first_episode(connection)).values(**values))

    return change


def remove_tick(connection: Connection) -> None:
    connection.execute(delete(ticks).where(ticks.c.episode_id == first_episode(connection), ticks.c.timestep == 17))


def remove_all_ticks(connection: Connection) -> None:
    connection.execute(delete(ticks).where(ticks.c.episode_id == first_episode(connection)))


@pytest.mark.parametrize(
    ("change", "told"),
    [
        (change_tick(state_hash=b"\0" * 8), "timestep 17: state hash"),
        (change_tick(reward_0=20), "timestep 17: rewards"),
        (change_tick(shaped_1=99), "timestep 17: shaped"),
        (change_tick(events_0=1 << 20), "timestep 17: events"),
        (change_tick(action_0=None), "timestep 17: no joint action"),
        (change_episode(score=1000), "score is"),
        (change_episode(soups=50), "soups is"),
        (change_episode(progress=0.5), "progress is"),
        (change_episode(final_hash="0" * 16), "final_hash is"),
        (remove_tick, "has no tick 17"),
        (remove_all_ticks, "no timestep is stored"),
    ],
    ids=[
        "hash",
        "reward",
        "shaped",
        "events",
        "action",
        "score",
        "soups",
        "progress",
        "final hash",
        "hole",
        "all lost",
    ],
)
def test_any_change_of_what_was_stored_is_found_and_named(
    filled: str, change: Callable[[Connection], None], told: str, capsys: pytest.CaptureFixture[str]
) -> None:
    with Database(filled) as database:
        episode = database.read_now(first_episode)
        database.write_now(change)
    assert verify(filled) == 1
    out = capsys.readouterr().out
    assert f"episode {episode}" in out
    assert told in out


def test_an_episode_that_ended_before_its_start_has_nothing_to_verify(filled: str) -> None:
    with Database(filled) as database:
        database.write_now(remove_all_ticks)
        database.write_now(change_episode(status="aborted"))
    assert verify(filled) == 0


def test_changed_action_shows_in_the_states_that_follow(filled: str, capsys: pytest.CaptureFixture[str]) -> None:
    def change(connection: Connection) -> None:
        here = ticks.c.episode_id == first_episode(connection)
        for timestep, action in connection.execute(select(ticks.c.timestep, ticks.c.action_0).where(here)).all():
            if timestep:
                turned = update(ticks).where(here, ticks.c.timestep == timestep)
                connection.execute(turned.values(action_0=(action + 1) % 4))

    with Database(filled) as database:
        database.write_now(change)
    assert verify(filled) == 1
    assert "state hash is" in capsys.readouterr().out


@pytest.mark.parametrize("command", [["verify"], ["export", "--out", "out"]], ids=["verify", "export"])
def test_wrong_input_is_reported_with_the_remedy(
    filled: str, command: list[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    empty = create_engine(f"sqlite:///{tmp_path}/empty.db")
    empty.connect().close()
    empty.dispose()
    wrong = [
        ([f"sqlite:///{tmp_path}/missing.db"], "there is no database"),
        ([f"sqlite:///{tmp_path}/empty.db"], "is not a kitchenmind database"),
        (["mysql://somewhere"], "not supported"),
        (["postgresql://nobody@127.0.0.1:1/none"], "cannot read"),
        ([filled, "--study", "unknown"], "It has: ring"),
    ]
    for words, told in wrong:
        assert kitchenmind.main([*command, "--database", *words]) == 2
        message = capsys.readouterr().err
        assert told in message, words
        assert message.startswith(f"kitchenmind {command[0]}: ")
    assert not (tmp_path / "out").exists()
    assert not (tmp_path / "missing.db").exists()
