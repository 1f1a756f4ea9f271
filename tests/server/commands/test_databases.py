"""Commands on a database of another version, such as an old backup: they say what it is, and show no SQL."""

from pathlib import Path

import pytest
from sqlalchemy import text

import kitchenmind
from server.store import engines
from tests.server.store.test_migrations import EARLIER, fill, make_as_of

COMMANDS = (
    ("verify",),
    ("export", "--out", "data"),
    ("person", "find", "KM-1", "--study", "ring"),
    ("study", "models"),
)


@pytest.fixture(scope="module")
def old(tmp_path_factory: pytest.TempPathFactory) -> str:
    """The address of a database of the first version, with a participant who played."""
    url = f"sqlite:///{tmp_path_factory.mktemp('old')}/backup.sqlite3"
    make_as_of(url, EARLIER[-1])
    writer = engines.WriteConnection(engines.normal_url(url))
    with writer.transaction() as connection:
        fill(connection)
    writer.close()
    return url


@pytest.mark.parametrize("command", COMMANDS, ids=" ".join)
def test_an_old_database_is_named_with_the_remedy(
    old: str,
    command: tuple[str, ...],
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.chdir(tmp_path)
    assert kitchenmind.main([*command, "--database", old]) == 2
    said = capsys.readouterr().err
    assert f"is of an earlier version ({EARLIER[-1]}). Start `kitchenmind serve`" in said
    assert "SELECT" not in said
    assert list(tmp_path.iterdir()) == []


def test_an_old_database_can_be_backed_up(old: str, tmp_path: Path) -> None:
    assert kitchenmind.main(["backup", "--database", old, "--to", str(tmp_path / "copy.sqlite3")]) == 0


def test_an_error_in_tables_of_this_version_is_not_explained_away(tmp_path: Path) -> None:
    url = f"sqlite:///{tmp_path}/study.sqlite3"
    make_as_of(url, "head")
    writer = engines.WriteConnection(engines.normal_url(url))
    with writer.transaction() as connection:
        connection.execute(text("DROP TABLE studies"))
    writer.close()
    with pytest.raises(Exception, match="no such table"):
        kitchenmind.main(["export", "--out", str(tmp_path / "data"), "--database", url])
