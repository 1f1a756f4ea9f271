"""Apply a change of a study's YAML to its parsed values, independent of their form in the text."""

from collections.abc import Callable, Sequence
from typing import Any

from server.study.yaml_writer import scalar

Path = Sequence[str | int]
Change = Callable[[Any], Any]


def as_read(value: Any) -> Any:
    """Return a value as the loader reads what is written for it: numbers and true/false as texts."""
    if isinstance(value, dict):
        return {str(key): as_read(one) for key, one in value.items()}
    if isinstance(value, list):
        return [as_read(one) for one in value]
    if value is None or isinstance(value, str):
        return value
    return scalar(value, flow=True)


def put(old: Any, path: Path, value: Any) -> Any:
    if not path:
        return as_read(value)
    first, rest = path[0], path[1:]
    if isinstance(first, int):
        items = list(old or ())
        items[first:] = [put(items[first] if first < len(items) else None, rest, value), *items[first + 1 :]]
        return items
    return dict(old or {}) | {first: put((old or {}).get(first), rest, value)}


def _inside(old: Any, path: Path, change: Change) -> Any:
    """Return `old` with `change` applied to the value at `path`."""
    if not path:
        return change(old)
    copy: Any = list(old) if isinstance(old, list) else dict(old)
    copy[path[0]] = _inside(copy[path[0]], path[1:], change)
    return copy


def removed(old: Any, path: Path) -> Any:
    def without(parent: Any) -> Any:
        if isinstance(parent, dict):
            return {key: value for key, value in parent.items() if key != path[-1]}
        return [value for index, value in enumerate(parent) if index != path[-1]]

    return _inside(old, path[:-1], without)


def inserted(old: Any, path: Path, index: int, value: Any) -> Any:
    return _inside(old, path, lambda items: [*items[:index], as_read(value), *items[index:]])


def moved(old: Any, path: Path, index: int, to: int) -> Any:
    def changed(items: list[Any]) -> list[Any]:
        rest = [*items[:index], *items[index + 1 :]]
        return [*rest[:to], items[index], *rest[to:]]

    return _inside(old, path, changed)


def renamed(old: Any, path: Path, key: str) -> Any:
    return _inside(
        old, path[:-1], lambda block: {key if one == path[-1] else one: value for one, value in block.items()}
    )
