"""Read a layout file: a drawn grid, or the dictionary of overcooked_ai's own `.layout` files. This kitchen has one
recipe and one set of rules. A dictionary may state them; anything else is refused, because a kitchen that silently
ignored the rules in its file would invalidate a study.
"""

import ast
import re
from collections.abc import Callable
from pathlib import Path
from typing import Any


class LayoutError(ValueError):
    """A grid that is not a valid kitchen. `row` and `column` count from 1; None if the fault has no single place."""

    def __init__(
        self, source: str, reason: str, remedy: str, row: int | None = None, column: int | None = None
    ) -> None:
        self.source, self.reason, self.remedy, self.row, self.column = source, reason, remedy, row, column
        place = "".join(f", {name} {value}" for name, value in (("row", row), ("column", column)) if value is not None)
        super().__init__(f"{source}{place}: {reason}. {remedy}")


_ONIONS = ["onion", "onion", "onion"]
# The default shaping of overcooked_ai, which is the one of overcooked.score.
_SHAPING = {
    "PLACEMENT_IN_POT_REW": 3,
    "DISH_PICKUP_REWARD": 3,
    "SOUP_PICKUP_REWARD": 5,
    "DISH_DISP_DISTANCE_REW": 0,
    "POT_DISTANCE_REW": 0,
    "SOUP_DISTANCE_REW": 0,
}


def _is(*wanted: Any) -> Callable[[Any], bool]:
    """Return whether a value is one of `wanted`; True does not count as 1."""
    return lambda value: any(value == one and isinstance(value, bool) == isinstance(one, bool) for one in wanted)


def _is_shaping(value: Any) -> bool:
    return value is None or (isinstance(value, dict) and _SHAPING | value == _SHAPING)


def _is_number(value: Any) -> bool:
    return isinstance(value, int | float)


# Keys of overcooked_ai's dictionary other than the grid -> (whether this kitchen supports the value, what this kitchen
# does).
_SETTINGS: dict[str, tuple[Callable[[Any], bool], str]] = {
    "layout_name": (lambda value: isinstance(value, str), "a name is a text"),
    "cook_time": (_is(20, None), "soups cook for 20 timesteps"),
    "recipe_times": (_is([20], [], None), "soups cook for 20 timesteps: [20]"),
    "delivery_reward": (_is(20, None), "a soup brings 20 points"),
    "recipe_values": (_is([20], [], None), "a soup brings 20 points: [20]"),
    "onion_time": (_is(None), "soups cook for 20 timesteps"),
    "onion_value": (_is(None), "a soup brings 20 points"),
    "tomato_time": (_is(None), "there are no tomatoes"),
    "tomato_value": (_is(None), "there are no tomatoes"),
    "num_items_for_soup": (_is(3, None), "a soup has 3 onions"),
    "max_num_ingredients": (_is(3, None), "a soup has 3 onions"),
    "start_all_orders": (_is([{"ingredients": _ONIONS}], None), "only the order of three onions can be cooked"),
    "start_bonus_orders": (_is([], None), "there are no bonus orders: []"),
    "order_bonus": (_is_number, "a bonus is a number"),
    "start_order_list": (_is(None), "there is no list of orders: every soup of three onions can be served"),
    "start_state": (_is(None), "every episode starts with empty counters and pots and the chefs on 1 and 2"),
    "rew_shaping_params": (_is_shaping, f"shaped rewards are {_SHAPING}"),
    "old_dynamics": (_is(True, None), "a pot starts to cook by itself with the third onion (old_dynamics = True)"),
}


def read_text(path: Path) -> str:
    """Return the text of a layout file, with or without a byte order mark. Raises LayoutError unless it is UTF-8."""
    try:
        return path.read_bytes().decode("utf-8-sig")
    except UnicodeDecodeError as error:
        reason = f"this is not UTF-8 (byte {error.start})"
        raise LayoutError(str(path), reason, "Save the file as UTF-8.") from None


def grid_rows(text: str, source: str) -> list[str]:
    """Return the rows of the grid in a layout file; `source` names it in errors. Raises LayoutError."""
    text = text.removeprefix("\ufeff")
    rows = _rows_of_dictionary(text, source) if text.lstrip().startswith("{") else text.strip("\r\n").splitlines()
    return [row.rstrip("\r") for row in rows]


def _rows_of_dictionary(text: str, source: str) -> list[str]:
    settings = _dictionary(text, source)
    grid = settings.pop("grid", None)
    if not isinstance(grid, str):
        raise LayoutError(source, 'the dictionary has no text under "grid"', 'Add "grid": """...""" with the rows.')
    for key, value in settings.items():
        if key not in _SETTINGS:
            known = ", ".join(_SETTINGS)
            raise LayoutError(source, f"unknown setting {key!r}", f"Remove it. Known in addition to grid: {known}.")
        is_done_here, what = _SETTINGS[key]
        if not is_done_here(value):
            reason = f"{key} = {_shortened(value)} is not supported"
            raise LayoutError(source, reason, f"In this kitchen {what}. Change or remove the line.")
    return [row.strip() for row in grid.strip().split("\n")]  # overcooked_ai strips every row: no border is blank


def _dictionary(text: str, source: str) -> dict[Any, Any]:
    try:
        tree = ast.parse(text.strip(), mode="eval").body
        settings = ast.literal_eval(tree)
        if not isinstance(tree, ast.Dict) or not isinstance(settings, dict):
            raise ValueError("no dictionary")
    except (SyntaxError, ValueError, TypeError, RecursionError, MemoryError) as error:
        if computed := re.search(r"malformed node or string on line (\d+)", str(error)):
            reason = "something is computed in the dictionary, and files are never executed"
            raise LayoutError(source, reason, "Write the value itself.", int(computed[1])) from None
        reason, row = f"this is not a readable dictionary ({error})", getattr(error, "lineno", None)
        raise LayoutError(source, reason, "Check quotes, commas and brackets.", row) from None
    if len(settings) != len(tree.keys):
        raise LayoutError(source, "a key occurs twice in the dictionary", "Keep only one of the two.")
    return settings


def _shortened(value: Any) -> str:
    words = repr(value)
    return words if len(words) <= 60 else f"{words[:60]} ..."
