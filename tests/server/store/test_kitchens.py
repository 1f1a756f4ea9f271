"""Kitchens that researchers draw: kept with their history, never overwritten by somebody else."""

from pathlib import Path

import pytest

from server.store import kitchens
from server.store.database import Database
from server.store.kitchens import KitchenConflict
from tests.support.databases import with_tables

GRID, OTHER = "XXPXX\nO1 2O\nXDXSX", "XXPXX\nO2 1O\nXDXSX"


def test_every_version_is_kept_with_its_author_and_the_newest_counts(database: Database) -> None:
    database.write_now(kitchens.save, "nook", GRID, "mara", 0)
    database.write_now(kitchens.save, "attic", GRID, "mara", 0)
    database.write_now(kitchens.save, "nook", OTHER, "ben", 1)
    history = database.read_now(kitchens.of_name, "nook")
    assert [(one.version, one.grid, one.saved_by) for one in history] == [(2, OTHER, "ben"), (1, GRID, "mara")]
    assert [(one.name, one.version) for one in database.read_now(kitchens.newest)] == [("attic", 1), ("nook", 2)]
    assert database.read_now(kitchens.grids) == {"attic": GRID, "nook": OTHER}
    assert kitchens.grids_at(database.url.render_as_string(hide_password=False)) == {"attic": GRID, "nook": OTHER}


@pytest.mark.parametrize("opened", [0, 1])
def test_a_change_that_began_before_somebody_elses_is_refused_and_loses_nothing(
    database: Database, opened: int
) -> None:
    database.write_now(kitchens.save, "nook", GRID, "mara", 0)
    database.write_now(kitchens.save, "nook", OTHER, "ben", 1)
    with pytest.raises(KitchenConflict, match="ben saved version 2 of nook") as refused:
        database.write_now(kitchens.save, "nook", GRID, "mara", opened)
    assert refused.value.newest.grid == OTHER
    assert len(database.read_now(kitchens.of_name, "nook")) == 2


def test_a_removed_kitchen_is_in_the_history_only_and_its_name_is_free_again(database: Database) -> None:
    database.write_now(kitchens.save, "nook", GRID, "mara", 0)
    database.write_now(kitchens.save, "nook", None, "mara", 1)
    assert database.read_now(kitchens.newest) == []
    assert database.read_now(kitchens.grids) == {}
    assert database.write_now(kitchens.save, "nook", OTHER, "ben", 0).version == 3
    assert database.read_now(kitchens.grids) == {"nook": OTHER}


def test_a_database_that_is_not_there_or_older_has_no_kitchens(tmp_path: Path) -> None:
    assert kitchens.grids_at(f"sqlite:///{tmp_path}/none.db") == {}
    url = with_tables(tmp_path / "old.db")
    with Database(url) as database:
        database.write_now(lambda connection: kitchens.kitchens.drop(connection))
    assert kitchens.grids_at(url) == {}
