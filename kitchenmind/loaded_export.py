"""`kitchenmind.load(...)`: the tables of an export, a folder or a zip file, with typed columns and their meanings."""

import io
import json
import warnings
import zipfile
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any, Final

import polars as pl

from server.export.files import from_text, table_path

CODEBOOK: Final = "codebook.json"
_TYPES: Final[Mapping[str, pl.DataType]] = {
    "integer": pl.Int64(),
    "number": pl.Float64(),
    "boolean": pl.Boolean(),
    "time": pl.Datetime("us", "UTC"),
}  # all other columns are text


class NotAnExport(ValueError):
    """The path is not an export that can be read; the message says why and what to do."""


class LoadedExport(Mapping[str, pl.DataFrame]):
    """The tables of an export. `export.episodes` and `export["episodes"]` read a table when it is first asked for.

    Numbers, times (UTC) and booleans have their types, also if the export has only CSV files. `export.codebook()`
    describes the tables, `export.codebook("episodes")` the columns of one.
    """

    def __init__(self, path: Path, root: Path | zipfile.Path, described: Mapping[str, Any]) -> None:
        self._path, self._root, self._described = path, root, described
        self._read: dict[str, pl.DataFrame] = {}

    def __getitem__(self, name: str) -> pl.DataFrame:
        if name not in self._described:
            raise KeyError(self._no_table(name))
        if name not in self._read:
            self._read[name] = self._table(name)
        return self._read[name]

    def __iter__(self) -> Iterator[str]:
        return iter(self._described)

    def __len__(self) -> int:
        return len(self._described)

    def __getattr__(self, name: str) -> pl.DataFrame:
        if name.startswith("_") or name not in self._described:
            raise AttributeError(self._no_table(name) if not name.startswith("_") else name)
        return self[name]

    def __dir__(self) -> list[str]:
        return sorted({*super().__dir__(), *self._described})

    def __repr__(self) -> str:
        return f"<kitchenmind export {self._path}: {', '.join(self._described)}>"

    def codebook(self, table: str | None = None) -> pl.DataFrame:
        """Return what the columns of a table mean (column, type, unit, meaning); without a table, what a row of each
        table is (table, row). Raises KeyError."""
        if table is None:
            rows = [(name, about["row"]) for name, about in self._described.items()]
            return pl.DataFrame(rows, schema={"table": pl.String, "row": pl.String}, orient="row")
        if table not in self._described:
            raise KeyError(self._no_table(table))
        names = ("type", "unit", "meaning")
        columns = self._described[table]["columns"].items()
        rows = [(name, *(about.get(key) for key in names)) for name, about in columns]
        return pl.DataFrame(rows, schema=dict.fromkeys(("column", *names), pl.String), orient="row")

    def _no_table(self, name: str) -> str:
        return f"{self._path} has no table {name!r}. It has: {', '.join(self._described)}."

    def _table(self, name: str) -> pl.DataFrame:
        """Read a table, as Parquet if the export has it. Raises NotAnExport."""
        for file_format in ("parquet", "csv"):
            inside = table_path(Path(), file_format, name).as_posix()
            file = self._root.joinpath(inside)
            if not file.is_file():
                continue
            try:
                content = io.BytesIO(file.read_bytes())
                return pl.read_parquet(content) if file_format == "parquet" else self._from_csv(name, content)
            except (pl.exceptions.PolarsError, OSError, zipfile.BadZipFile) as error:
                why = (str(error).splitlines() or [type(error).__name__])[0]
                raise NotAnExport(f"{self._path}: {inside} cannot be read ({why}). Export the study again.") from None
        raise NotAnExport(f"{self._path} has no file with the table {name!r}. Export the study again.")

    def _from_csv(self, name: str, content: io.BytesIO) -> pl.DataFrame:
        """Read a CSV file with the types of the codebook, without the apostrophes that protect spreadsheets."""
        types = {column: _TYPES.get(about["type"]) for column, about in self._described[name]["columns"].items()}
        table = pl.read_csv(content, infer_schema=False)
        return table.with_columns(from_text(column, types.get(column)) for column in table.columns)


def load(path: str | Path) -> LoadedExport:
    """Return the export in this folder or zip file, which `kitchenmind export` or the dashboard made. Tables are read
    when they are first used. Warns if it has both people and simulated participants, which must not be pooled. Raises
    FileNotFoundError, and NotAnExport if it is something else."""
    given = Path(path)
    if not given.exists():
        raise FileNotFoundError(f"{given} does not exist. Give the folder that `kitchenmind export --out` wrote.")
    root = _root(given)
    try:
        book = json.loads(root.joinpath(CODEBOOK).read_text(encoding="utf-8"))
        tables = {
            str(name): {"row": about["row"], "columns": dict(about["columns"])}
            for name, about in book["tables"].items()
        }
    except (ValueError, KeyError, TypeError, AttributeError, OSError, zipfile.BadZipFile) as error:
        reason = f"{type(error).__name__}: {error}"
        raise NotAnExport(f"{given}: {CODEBOOK} cannot be read ({reason}). Export the study again.") from None
    export = LoadedExport(given, root, tables)
    _warn_of_both_kinds(export)
    return export


def _warn_of_both_kinds(export: LoadedExport) -> None:
    """Warn if simulated participants are among people: every table then has rows of both."""
    if "simulated" not in export.codebook("participants")["column"]:
        return  # an older export, which does not say
    try:
        simulated = export["participants"]["simulated"]
    except NotAnExport:
        return  # told when that table is asked for
    bots, people = int(simulated.sum()), int((~simulated).sum())
    if bots and people:
        words = (
            f"This export has {people} people and {bots} simulated participants. Never pool them: keep those with "
            "`export.participants.filter(~pl.col('simulated'))`, and of other tables only rows about these people."
        )
        warnings.warn(words, stacklevel=3)


def _root(given: Path) -> Path | zipfile.Path:
    """Return where codebook.json is: at the top, or in the only folder that has one. Raises NotAnExport."""
    top: Path | zipfile.Path = given
    if given.is_file():
        if not zipfile.is_zipfile(given):
            raise NotAnExport(f"{given} is not a zip file. Give an export: a folder, or the zip file of the dashboard.")
        top = zipfile.Path(given)
    places = [top, *(inner for inner in top.iterdir() if inner.is_dir())]
    found = [place for place in places if place.joinpath(CODEBOOK).is_file()]
    if len(found) > 1 and found[0] is not top:
        names = ", ".join(sorted(place.name for place in found))
        raise NotAnExport(f"{given} has several exports. Give the path of one of them: {names}.")
    if not found:
        remedy = "Give the folder that `kitchenmind export --out` wrote, or the zip file of the dashboard."
        raise NotAnExport(f"{given} is not an export: it has no {CODEBOOK}. {remedy}")
    return found[0]
