"""Which trained agents and predictors of one's own a version of a study plays with: KITCHEN/NAME -> SHA-256."""

from collections.abc import Mapping
from typing import Annotated, Final

import yaml
from pydantic import Field

KEY: Final = "checkpoints"
_Place = Annotated[str, Field(pattern=r"^[a-z][a-z0-9_]{0,39}/[A-Za-z0-9][A-Za-z0-9_.-]{0,79}$")]
_Sha256 = Annotated[str, Field(pattern=r"^[0-9a-f]{64}$")]
Checkpoints = dict[_Place, _Sha256]


def with_checkpoints(text: str, found: Mapping[str, str]) -> str:
    """Return the study's text with these checkpoints in front of its first key, or of those that it has; everything
    else stays as it was written. `text` must be a study that can be read, without any of them."""
    root = yaml.compose(text, Loader=yaml.BaseLoader)
    if not found or not isinstance(root, yaml.MappingNode):
        return text
    pinned = next((value for key, value in root.value if key.value == KEY), None)
    if isinstance(pinned, yaml.MappingNode) and pinned.value:
        return _inserted(text, pinned, found)
    start = root.value[0][0].start_mark
    indent = " " * start.column
    if root.flow_style:
        written = f"{KEY}: {{{', '.join(_entries(found))}}}, "
    else:
        written = f"{KEY}:\n" + "".join(f"{indent}  {entry}\n" for entry in _entries(found)) + indent
    return text[: start.index] + written + text[start.index :]


def _inserted(text: str, block: yaml.MappingNode, found: Mapping[str, str]) -> str:
    start = block.value[0][0].start_mark
    end = ", " if block.flow_style else f"\n{' ' * start.column}"
    return text[: start.index] + "".join(entry + end for entry in _entries(found)) + text[start.index :]


def _entries(found: Mapping[str, str]) -> list[str]:
    """Return the entries in quotes: a SHA-256 may have digits only."""
    return [f'{name}: "{sha256}"' for name, sha256 in sorted(found.items())]
