"""Changes to a study's YAML that leave everything else as it is written: comments, order, quotes and unknown keys.

The text of one value is replaced where the parser found it. A library that reads and writes YAML (ruamel.yaml) keeps
comments, but not every space and line break. After each change the text is read again and compared with what the
change asked for, so that a change is either exact or refused.
"""

from collections.abc import Collection
from typing import Any

import yaml

from server.study import yaml_values
from server.study.loader import StudyComposer, StudyError, compose, values_of
from server.study.yaml_places import entry, is_alias, line_end, line_start, segments, value_end
from server.study.yaml_values import Change, Path, as_read
from server.study.yaml_writer import block, inline, scalar


class YamlEditError(ValueError):
    """A change that cannot be made without changing something else. The message has the remedy."""


class _Composer(StudyComposer):
    """Gives an alias its own place: PyYAML returns the node that it stands for."""

    def compose_node(self, parent: yaml.Node | None, index: Any) -> yaml.Node | None:
        event = self.peek_event() if self.check_event(yaml.AliasEvent) else None  # type: ignore[no-untyped-call]
        node = super().compose_node(parent, index)
        if event is None or node is None:
            return node
        alias = type(node)(node.tag, node.value, event.start_mark, event.end_mark)
        alias.is_alias = True  # type: ignore[attr-defined]
        return alias


def put(text: str, path: Path, value: Any, *, plain: bool = False) -> str:
    """Make the value at `path` equal to `value`; missing blocks above it are made. `plain`: a number or true/false,
    given as the text to write. Raises StudyError for a text that cannot be read, YamlEditError."""
    root = _compose(text)
    known, rest = _deepest(root, path)
    if plain and len(rest) > 1:
        value = _unquoted(value)  # it is part of a block that is written whole
    if rest:
        parent = _at(root, known)
        if isinstance(parent, yaml.SequenceNode):
            return insert(text, known, len(parent.value), _wrapped(rest[1:], value))
        if isinstance(parent, yaml.MappingNode):
            made = _with_key(text, parent, str(rest[0]), _wrapped(rest[1:], value), plain and len(rest) == 1)
            return _checked(root, made, lambda old: yaml_values.put(old, path, value))
        return put(text, known, _wrapped(rest, value))
    node = _at(root, path)
    if values_of(node) == as_read(value):
        return text
    if isinstance(value, dict) and isinstance(node, yaml.MappingNode) and node.value and value:
        return _put_keys(text, path, values_of(node), value)
    if isinstance(value, list) and isinstance(node, yaml.SequenceNode) and node.value and value:
        return _put_items(text, path, len(node.value), value)
    return _checked(root, _replaced(text, root, path, value, plain), lambda old: yaml_values.put(old, path, value))


def _unquoted(value: Any) -> Any:
    """Return the number, or true or false, that a text stands for; any other text as it is."""
    try:
        read = yaml.safe_load(value) if isinstance(value, str) else value
    except yaml.YAMLError:
        return value
    return read if isinstance(read, bool | int | float) else value


def has(text: str, path: Path) -> bool:
    """Return whether there is a value at `path`. Raises StudyError."""
    return not _deepest(_compose(text), path)[1]


def remove(text: str, path: Path) -> str:
    """Remove a key or an item of a list; its block stays, if empty as {} or []. Raises StudyError, YamlEditError."""
    root = _compose(text)
    parent = _at(root, path[:-1])
    places = segments(text, parent)
    index = _index(parent, path[-1])
    if len(places) == 1:
        empty: Any = {} if isinstance(parent, yaml.MappingNode) else []
        made = _replaced(text, root, path[:-1], empty, plain=False) if len(path) > 1 else ""
    elif parent.flow_style:
        begin, end = places[index]
        begin, end = (places[index - 1][1], end) if index else (begin, places[1][0])
        made = text[:begin] + text[end:]
    else:
        made = _without_lines(text, places, index)
    return _checked(root, made, lambda old: yaml_values.removed(old, path))


def keep(text: str, path: Path, items: Collection[int]) -> str:
    """Remove the other items of a list; those that stay keep their words, comments and order."""
    node = _at(_compose(text), path)
    if not isinstance(node, yaml.SequenceNode):
        raise YamlEditError("this is not a list. Change it in the YAML.")
    count = len(node.value)
    for index in sorted(set(range(count)) - set(items), reverse=True):
        text = remove(text, (*path, index))
    return text


def insert(text: str, path: Path, index: int, value: Any) -> str:
    """Put an item into the list at `path`, before the item `index`. Raises StudyError, YamlEditError."""
    root = _compose(text)
    node = _at(root, path)
    if not isinstance(node, yaml.SequenceNode):
        raise YamlEditError("this is not a list. Change it in the YAML.")
    if not node.value:
        return put(text, path, [value])
    places = segments(text, node)
    if node.flow_style:
        at = places[index][0] if index < len(places) else places[-1][1]
        made = f"{inline(value)}, " if index < len(places) else f", {inline(value)}"
        made = text[:at] + made + text[at:]
    else:
        column = node.start_mark.column
        item = _item(value, column)
        at = line_end(text, places[index - 1][1]) if index else line_start(text, places[0][0])
        made = text[:at] + (f"\n{item}" if index else f"{item}\n") + text[at:]
    return _checked(root, made, lambda old: yaml_values.inserted(old, path, index, value))


def move(text: str, path: Path, index: int, to: int) -> str:
    """Move an item of the list at `path` to another place, with the comments above it. Raises StudyError,
    YamlEditError."""
    root = _compose(text)
    node = _at(root, path)
    places = segments(text, node)
    if not isinstance(node, yaml.SequenceNode) or not (0 <= index < len(places) and 0 <= to < len(places)):
        raise YamlEditError("there is no such item in this list. Reload the page.")
    if not node.flow_style:  # whole lines, each with what stands above it
        begin = line_start(text, places[0][0])
        ends = [line_end(text, end) for _, end in places]
        places = list(zip([begin, *(end + 1 for end in ends[:-1])], ends, strict=True))
    between = [text[places[k][1] : places[k + 1][0]] for k in range(len(places) - 1)]
    items = [text[begin:end] for begin, end in places]
    items.insert(to, items.pop(index))
    joined = "".join(item + gap for item, gap in zip(items, [*between, ""], strict=True))
    made = text[: places[0][0]] + joined + text[places[-1][1] :]
    return _checked(root, made, lambda old: yaml_values.moved(old, path, index, to))


def rename(text: str, path: Path, key: str) -> str:
    """Give a key another name. Raises StudyError, YamlEditError."""
    root = _compose(text)
    parent = _at(root, path[:-1])
    node = parent.value[_index(parent, path[-1])][0]
    if any(str(other.value) == key for other, _ in parent.value):
        raise YamlEditError(f"the key {key!r} already exists. Choose another name.")
    made = text[: node.start_mark.index] + scalar(key, flow=True) + text[node.end_mark.index :]
    return _checked(root, made, lambda old: yaml_values.renamed(old, path, key))


# Helper functions


def _compose(text: str) -> yaml.MappingNode:
    return compose(text, "study.yaml", _Composer)


def _at(root: yaml.Node, path: Path) -> Any:
    """Return the node at a path. Raises YamlEditError where there is none, or where it stands elsewhere."""
    node = root
    for piece in path:
        if is_alias(node):
            raise YamlEditError("this value is defined elsewhere in the file (an alias). Change it in the YAML.")
        found = entry(node, piece)
        if found is None:
            raise YamlEditError(f"the file has no {'.'.join(map(str, path))}. Reload the page.")
        node = found
    return node


def _deepest(root: yaml.Node, path: Path) -> tuple[Path, Path]:
    """Split a path into what the file has and what is to be made."""
    node = root
    for count, piece in enumerate(path):
        found = None if is_alias(node) else entry(node, piece)
        if found is None:
            return path[:count], path[count:]
        node = found
    return path, ()


def _wrapped(rest: Path, value: Any) -> Any:
    for piece in reversed(rest):
        value = {str(piece): value} if isinstance(piece, str) else [value]
    return value


def _index(parent: yaml.Node, piece: str | int) -> int:
    if isinstance(parent, yaml.MappingNode):
        names = [str(key.value) for key, _ in parent.value]
        if piece in names:
            return names.index(str(piece))
    elif isinstance(parent, yaml.SequenceNode) and isinstance(piece, int) and 0 <= piece < len(parent.value):
        return piece
    raise YamlEditError(f"the file has no {piece!r} here. Reload the page.")


def _with_key(text: str, parent: yaml.MappingNode, key: str, value: Any, plain: bool) -> str:
    name = scalar(key, flow=True)
    if not parent.value:
        at = parent.end_mark.index - 1
        return f"{text[:at]}{name}: {inline(value, plain=plain)}{text[at:]}"
    if parent.flow_style:
        at = value_end(text, parent.value[-1][1])
        return f"{text[:at]}, {name}: {inline(value, plain=plain)}{text[at:]}"
    column = parent.value[0][0].start_mark.column
    at = line_end(text, value_end(text, parent.value[-1][1]))
    return f"{text[:at]}\n{' ' * column}{name}:{block(value, column, plain=plain)}{text[at:]}"


def _replaced(text: str, root: yaml.Node, path: Path, value: Any, plain: bool) -> str:
    node, parent = _at(root, path), _at(root, path[:-1])
    is_scalar = isinstance(node, yaml.ScalarNode) and not is_alias(node)
    quoted = is_scalar and node.style in ("'", '"')
    end = value_end(text, node)
    if _is_in_flow(root, path):
        return text[: node.start_mark.index] + inline(value, plain=plain, quoted=quoted) + text[end:]
    in_list = isinstance(parent, yaml.SequenceNode)
    column = parent.start_mark.column
    words = block(value, column, plain=plain, quoted=quoted, item=in_list)
    if (is_scalar and node.start_mark.index == node.end_mark.index) or not words.startswith("\n"):
        begin = node.start_mark.index if is_scalar or node.flow_style else _after_mark(text, node, parent, path[-1])
        gap = "" if text[begin - 1 : begin] in (" ", "\n") else " "
        return text[:begin] + (words if words.startswith("\n") else gap + words[1:]) + text[end:]
    begin = _after_mark(text, node, parent, path[-1])
    return text[:begin] + words + text[end:]


def _after_mark(text: str, node: yaml.Node, parent: yaml.Node, piece: str | int) -> int:
    """Return where a value begins in its line: after the colon of its key, or after its dash."""
    if isinstance(parent, yaml.MappingNode):
        return text.index(":", parent.value[_index(parent, piece)][0].end_mark.index) + 1
    return text.rindex("-", 0, node.start_mark.index) + 1


def _is_in_flow(root: yaml.Node, path: Path) -> bool:
    return any(getattr(_at(root, path[:count]), "flow_style", False) for count in range(len(path)))


def _without_lines(text: str, places: list[tuple[int, int]], index: int) -> str:
    begin, end = places[index]
    if text[line_start(text, begin) : begin].strip():  # the first key after a dash: the next one takes its place
        return text[:begin] + text[places[index + 1][0] :]
    return text[: line_start(text, begin)] + text[line_end(text, end) + 1 :]


def _item(value: Any, column: int) -> str:
    words = block(value, column, item=True)
    return f"{' ' * column}-{words}"


def _put_keys(text: str, path: Path, old: dict[str, Any], new: dict[str, Any]) -> str:
    for key, value in new.items():
        if key not in old or old[key] != as_read(value):
            text = put(text, (*path, key), value)
    for key in old:
        if key not in new:
            text = remove(text, (*path, key))
    return text


def _put_items(text: str, path: Path, old: int, new: list[Any]) -> str:
    for index, value in enumerate(new):
        text = put(text, (*path, index), value) if index < old else insert(text, path, index, value)
    for index in range(old - 1, len(new) - 1, -1):
        text = remove(text, (*path, index))
    return text


def _checked(root: yaml.Node, made: str, change: Change) -> str:
    """Return the changed text if it has exactly the requested change."""
    expected = change(values_of(root))
    try:
        if values_of(made) == expected:
            return made
    except StudyError:
        pass
    raise YamlEditError("this cannot be changed without changing something else. Change it in the YAML.")
