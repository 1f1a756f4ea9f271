"""Addresses of databases: understood, refused with the remedy, and shown without passwords."""

import re
from pathlib import Path

import pytest
from sqlalchemy import text

import kitchenmind
from server.store.database import Database
from server.store.engines import normal_url, shown
from server.store.migrate import migrate


@pytest.mark.parametrize("address", ["nonsense", "mysql://root@host/name", "sqlite://", "sqlite:///:memory:"])
def test_address_of_something_else_is_refused_with_the_remedy(address: str) -> None:
    with pytest.raises(ValueError, match="Use sqlite:///"):
        Database(address)


@pytest.mark.parametrize(
    "address",
    [
        "postgresql:/kitchenmind:hunter2@host/name",
        "kitchenmind:hunter2@host/name",
        "postgresql://kitchenmind:1hunter2@host:port/name",
        "mysql://root:hunter2@host/name",
        "postgresql://ada:first@hunter2@host/name",
        "postgresql://ada:first@hunter2/more@host/name",
    ],
)
def test_address_that_is_not_understood_is_not_shown_as_it_may_hold_a_password(address: str) -> None:
    with pytest.raises(ValueError, match="Use sqlite:///") as refused:
        normal_url(address)
    assert "hunter" not in str(refused.value)


def test_addresses_are_shown_without_their_password_wherever_it_stands() -> None:
    for address in (
        "postgresql://ada:hunter2@host/name",
        "postgresql://ada@host/name?password=hunter2&sslmode=require",
    ):
        assert "hunter" not in shown(normal_url(address))
    assert shown(normal_url("postgresql://ada@host/name?sslmode=require")).endswith("ada@host/name?sslmode=require")


@pytest.mark.parametrize(
    ("address", "message"),
    [
        ("sqlite://folder/x.db", r"has two slashes\. Write sqlite:///folder/x\.db"),
        ("sqlite://x.db", r"has two slashes\. Write sqlite:///x\.db"),
        ("sqlite://somebody@host/x.db", "has two slashes"),
        ("sqlite:///has?query.db", r"a \? ends the name of the file\. Write %3F"),
        ("sqlite:///x.db?mode=ro", r"a \? ends the name"),
        ("sqlite:///", "in memory"),
        ("sqlite:///:memory:", "in memory"),
        ("sqlite:///folder", "is a folder. Give a file in it: sqlite:///folder/file.db"),
        ("sqlite:///folder/", "is a folder"),
    ],
)
@pytest.mark.parametrize("verb", ["serve", "doctor", "export", "verify", "backup", "admin"])
def test_address_that_means_another_file_is_refused_and_leaves_nothing(
    verb: str,
    address: str,
    message: str,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    (tmp_path / "folder").mkdir()
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("KITCHENMIND_DATABASE", address)
    words = {"export": ["--out", "out"], "backup": ["--to", "copy.db"], "admin": ["list"], "serve": ["--port", "0"]}
    assert kitchenmind.main([verb, *words.get(verb, [])]) in (1, 2)
    captured = capsys.readouterr()
    assert re.search(message, captured.out + captured.err)
    assert [path.name for path in tmp_path.rglob("*")] == ["folder"]


def test_question_mark_in_the_name_of_a_file_can_be_written(tmp_path: Path) -> None:
    address = f"sqlite:///{tmp_path}/has%3Fquery%23.db"
    migrate(address)
    with Database(address) as database:
        assert database.read_now(lambda connection: connection.execute(text("SELECT 1")).scalar()) == 1
    assert (tmp_path / "has?query#.db").is_file()
