"""Changes that the study builder offers for a problem: one click, and the rest of the text stays as it is. Pure."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

_Path = tuple[str | int, ...]


@dataclass(frozen=True)
class QuickFix:
    """A change that solves a problem. `label`: the words on its button; `operation`: as `drafting.changed` takes it."""

    label: str
    operation: Mapping[str, Any]


def write(label: str, path: _Path, value: Any) -> QuickFix:
    """Write a value at a place of the text."""
    return QuickFix(label, {"do": "put", "path": list(path), "value": value})


def leave_out(label: str, path: _Path) -> QuickFix:
    """Remove a key or an item of a list."""
    return QuickFix(label, {"do": "remove", "path": list(path)})


def leave_in(label: str, path: _Path, items: Sequence[int]) -> QuickFix:
    """Remove the other items of a list."""
    return QuickFix(label, {"do": "keep", "path": list(path), "items": list(items)})


def insert(label: str, path: _Path, index: int, value: Any) -> QuickFix:
    """Put an item into a list, before the item `index`."""
    return QuickFix(label, {"do": "insert", "path": list(path), "index": index, "value": value})


def keep_only(label: str, path: _Path, kept: Sequence[Any]) -> QuickFix:
    """Leave those items of a list that are valid, or remove the list if none is."""
    return write(label, path, list(kept)) if kept else leave_out(label, path)
