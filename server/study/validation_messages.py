"""Turn pydantic's errors about single values into messages with reason and remedy."""

from collections.abc import Callable, Iterator
from typing import Any

from pydantic import ValidationError

from server.study.checks import Path, Problem

# pydantic's type of an error -> (reason, remedy); {} are the value and the limits of the error's context.
_WORDS = {
    "int_parsing": ("{input} is not a whole number", "Write a whole number."),
    "int_type": ("{input} is not a whole number", "Write a whole number."),
    "int_from_float": ("{input} is not a whole number", "Write a whole number."),
    "float_parsing": ("{input} is not a number", "Write a number."),
    "float_type": ("{input} is not a number", "Write a number."),
    "bool_parsing": ("{input} is neither true nor false", "Write true or false."),
    "bool_type": ("{input} is neither true nor false", "Write true or false."),
    "string_type": ("{input} is not a text", "Put the value in quotes."),
    "tuple_type": ("this is not a list", "Write a list: one `- ...` a line."),
    "dict_type": ("this is not a block", "Write a block of `key: value` lines."),
    "model_type": ("this is not a block", "Write a block of `key: value` lines."),
    "model_attributes_type": ("this is not a block", "Write a block of `key: value` lines."),
    "string_pattern_mismatch": ("{input} is not possible here", "It must look like {pattern}."),
    "greater_than": ("{input} is too small", "Write more than {gt}."),
    "greater_than_equal": ("{input} is too small", "Write {ge} or more."),
    "less_than": ("{input} is too large", "Write less than {lt}."),
    "less_than_equal": ("{input} is too large", "Write {le} or less."),
    "too_short": ("there are too few", "Write at least {min_length}."),
    "too_long": ("there are too many", "Keep at most {max_length}."),
    "union_tag_invalid": ("unknown type", "Use {expected_tags}."),
    "union_tag_not_found": (
        "the type is missing",
        "Add `type:`, one of scale, choice, multiple, text, number, ranking, published.",
    ),
    "literal_error": ("{input} is not possible here", "Use {expected}."),
}
_PATTERNS = {
    r"^[a-z][a-z0-9_]{0,39}$": "Use up to 40 lowercase letters, digits and _, a letter first.",
    r"^[a-z][a-z0-9_-]{0,39}$": "Use up to 40 lowercase letters, digits, - and _, a letter first.",
}
_MAX_INPUT_LENGTH = 40


def problems_of(error: ValidationError, nearest: Callable[[Path], Path]) -> Iterator[Problem]:
    """Return all problems, each once. `nearest` gives the part of a path that the file has."""
    found = error.errors(include_url=False)
    for one in found:
        if not _follows_from_another(one, found):
            yield _problem(one, nearest)


def _follows_from_another(one: Any, found: list[Any]) -> bool:
    """Return whether the error only follows from another: pydantic also reports a list with invalid items as too
    short."""
    path = one["loc"]
    return one["type"] == "too_short" and any(other["loc"][: len(path)] == path for other in found if other is not one)


def _problem(error: Any, nearest: Callable[[Path], Path]) -> Problem:
    path: Path = tuple(error["loc"])
    context = error.get("ctx", {})
    kind, message = error["type"], error["msg"]
    if kind == "unknown_key":
        reason = context.get("reason", f"unknown key {context['key']!r}")
        return Problem((*nearest(path), context["key"]), reason, context["remedy"])
    if kind == "missing":
        return Problem(nearest(path[:-1]), f"{path[-1]!r} is missing here", f"Add `{path[-1]}: ...`.")
    if kind == "value_error":
        reason, _, remedy = str(context["error"]).rpartition(". ")
        return Problem(nearest(path), reason or remedy, f"{remedy}." if reason else "")
    if kind in _WORDS:
        is_out_of_range = kind.startswith(("greater_than", "less_than"))
        numbers = context | {"input": str(error["input"]) if is_out_of_range else _shortened(error["input"])}
        reason, remedy = (words.format_map(numbers) for words in _WORDS[kind])
        return Problem(nearest(path), reason, _PATTERNS.get(context.get("pattern"), remedy))
    return Problem(nearest(path), message[0].lower() + message[1:], "")


def _shortened(value: Any) -> str:
    words = repr(value)
    return words if len(words) <= _MAX_INPUT_LENGTH else f"{words[:_MAX_INPUT_LENGTH]} ..."
