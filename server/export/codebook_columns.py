"""The types of columns and tables of an export, and short constructors for columns."""

from dataclasses import dataclass
from functools import cached_property
from typing import Any


@dataclass(frozen=True)
class Column:
    """One column of a table. `small`: an integer of 16 bits."""

    name: str
    type: str
    meaning: str
    unit: str = ""
    bits: int = 64

    def described(self) -> dict[str, Any]:
        return {"type": self.type, "unit": self.unit or None, "meaning": self.meaning}


@dataclass(frozen=True)
class ExportTable:
    """One table: `row` says what a row is."""

    name: str
    row: str
    columns: tuple[Column, ...]

    @cached_property
    def names(self) -> list[str]:
        return [column.name for column in self.columns]


def text(name: str, meaning: str) -> Column:
    return Column(name, "text", meaning)


def code(name: str, meaning: str) -> Column:
    return Column(name, "integer", meaning, bits=16)


def ms(name: str, meaning: str) -> Column:
    return Column(name, "number", meaning, "ms")


def timesteps(name: str, meaning: str) -> Column:
    return Column(name, "integer", meaning, "timesteps", bits=32)


def points(name: str, meaning: str) -> Column:
    return Column(name, "integer", meaning, "points", bits=16)


def time(name: str, meaning: str) -> Column:
    return Column(name, "time", meaning, "UTC")


def seats(column: Column) -> tuple[Column, Column]:
    """Return the column for each of the two chefs."""
    meanings = (f"{column.meaning} Chef {seat}." for seat in (0, 1))
    first, second = (
        Column(f"{column.name}_{seat}", column.type, meaning, column.unit, column.bits)
        for seat, meaning in enumerate(meanings)
    )
    return first, second


# Columns of several tables.
STUDY = (
    text("study", "The study's name."),
    Column("study_version", "integer", "1 for the first text of the study file, 2 for the next, ...", bits=32),
)
PARTICIPANT = text("participant", "Random id from this platform, not the recruiter's.")
EPISODE = text("episode", "Random id of the episode.")
STEP = text("step", "Key of the participant's step in the study.")
