"""Write the grids of kitchens that a study only names into the text of its file."""

import json
from collections.abc import Iterator, Mapping

import yaml

_LAYOUTS = "layouts"


def with_grids(text: str, grids: Mapping[str, str]) -> str:
    """Return the study's text with `grid` for each kitchen that is in `grids` and has none of its own; everything else
    stays as it was written. `text` must be a study that can be read."""
    places = sorted(_places(yaml.compose(text, Loader=yaml.BaseLoader), grids), reverse=True)
    for at, column, name in places:
        text = text[:at] + _written(grids[name], column) + text[at:]
    return text


def _places(root: yaml.Node | None, grids: Mapping[str, str]) -> Iterator[tuple[int, int | None, str]]:
    """Yield where the `name` of such a kitchen begins: index, column (None inside of braces), the name."""
    blocks = []
    for key, value in _entries(root):
        if key.value == _LAYOUTS and isinstance(value, yaml.SequenceNode):
            blocks += value.value
        if key.value == "tutorial":
            blocks += [inner for name, inner in _entries(value) if name.value == "layout"]
    for node in {id(block): block for block in blocks}.values():  # an alias is the same node again
        entries = {key.value: (key, value) for key, value in _entries(node)}
        if "name" not in entries or "grid" in entries:
            continue
        key, value = entries["name"]
        if value.value in grids:
            yield key.start_mark.index, None if node.flow_style else key.start_mark.column, value.value


def _entries(node: yaml.Node | None) -> list[tuple[yaml.ScalarNode, yaml.Node]]:
    return node.value if isinstance(node, yaml.MappingNode) else []


def _written(grid: str, column: int | None) -> str:
    """Return the key `grid` in front of the key `name`: in braces as one quoted text, else as a block of rows."""
    if column is None:
        return f"grid: {json.dumps(grid)}, "
    rows = "".join(f"{' ' * (column + 2)}{row}\n" for row in grid.splitlines())
    return f"grid: |-\n{rows}{' ' * column}"
