"""The notebooks of the documents run from top to bottom, and are stored with what they show."""

import json
from pathlib import Path
from typing import Any

import pytest
from sqlalchemy import Connection, func

from server.export.writer import export
from server.settings import ROOT
from server.store.database import Database
from server.store.tables import episodes
from tests.support.databases import with_tables
from tests.support.study_data import fill

NOTEBOOKS = sorted((ROOT / "docs" / "notebooks").glob("*.ipynb"))
CELL_TIMEOUT_S = 300


@pytest.fixture(scope="module")
def exported(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The export of a small played study."""
    folder = tmp_path_factory.mktemp("notebooks")
    with Database(with_tables(folder / "study.db")) as database:
        database.write_now(fill, people=4, per_person=2)
        database.write_now(some_points)
        database.read_now(export, folder / "export")
    return folder / "export"


def some_points(connection: Connection) -> None:
    """Invent scores: the played episodes have none, as their actions are random."""
    points = 20 * (episodes.c.number + func.length(episodes.c.condition))
    connection.execute(episodes.update().values(score=points, soups=points / 20))


def outputs(notebook: Any) -> list[tuple[str, list[str]]]:
    """The source of every cell that shows something, and the kinds of what it shows."""
    return [
        ("".join(cell["source"]), [output["output_type"] for output in cell["outputs"]])
        for cell in notebook["cells"]
        if cell["cell_type"] == "code" and cell["outputs"]
    ]


def test_there_are_three_and_each_is_in_the_guide() -> None:
    guide = (ROOT / "docs" / "guides" / "notebooks.md").read_text("utf-8")
    assert len(NOTEBOOKS) == 3
    assert [one.name for one in NOTEBOOKS if f"(../notebooks/{one.name})" not in guide] == []


@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_stored_output_has_no_error_and_no_folder_of_one_machine(path: Path) -> None:
    text = path.read_text("utf-8")
    assert len(outputs(json.loads(text))) >= 2
    assert '"output_type": "error"' not in text
    folders = ("/home/", "/Users/", "/tmp/", "site-packages", str(Path.home()), str(ROOT))
    assert not [folder for folder in folders if folder in text]


@pytest.mark.slow
@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_notebook_runs_from_top_to_bottom(
    path: Path, exported: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """In a separate folder, with a kernel of this Python; a cell that raises fails the test."""
    import nbformat
    from nbclient import NotebookClient

    monkeypatch.setenv("EXPORT", str(exported))
    monkeypatch.setenv("PYTHONPATH", str(ROOT))
    stored = nbformat.read(path, as_version=4)
    run = nbformat.read(path, as_version=4)
    client = NotebookClient(
        run, timeout=CELL_TIMEOUT_S, kernel_name="python3", resources={"metadata": {"path": str(tmp_path)}}
    )
    client.execute()
    assert outputs(run) == outputs(stored), "execute the notebook again and store it"
