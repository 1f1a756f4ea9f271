"""An export of this test's database."""

import csv
from collections.abc import Callable
from pathlib import Path

import polars as pl
import pytest

import kitchenmind
from server.export import codebook

TABLES = [table.name for table in codebook.TABLES]
Exported = Callable[..., Path]


# What is written after the rows have been read is the same for every kind of database.
of_any_kind = pytest.mark.parametrize("url", ["sqlite"], indirect=True)


@pytest.fixture
def exported(url: str, tmp_path: Path) -> Exported:
    """Export the database of this test into a folder."""

    def run(*words: str, name: str = "out") -> Path:
        folder = tmp_path / name
        assert kitchenmind.main(["export", "--database", url, "--out", str(folder), *words]) == 0
        return folder

    return run


def parquet(folder: Path, table: str) -> pl.DataFrame:
    return pl.read_parquet(folder / "parquet" / f"{table}.parquet")


def csv_rows(folder: Path, table: str) -> list[dict[str, str]]:
    with (folder / "data" / f"description-{table}_data.csv").open(newline="", encoding="utf-8") as file:
        return list(csv.DictReader(file))
