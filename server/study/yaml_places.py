"""Where the values of a YAML text begin and end, from the nodes of PyYAML: without the comments that follow them."""

import yaml


def is_alias(node: yaml.Node) -> bool:
    """Return whether it is an alias, which stands for a value at another place."""
    return getattr(node, "is_alias", False)


def entry(node: yaml.Node, piece: str | int) -> yaml.Node | None:
    """Return what a block has under a key, or a list at a place; None if there is nothing."""
    if isinstance(node, yaml.MappingNode):
        return next((value for key, value in node.value if str(key.value) == piece), None)
    if isinstance(node, yaml.SequenceNode) and isinstance(piece, int) and 0 <= piece < len(node.value):
        found: yaml.Node = node.value[piece]
        return found
    return None


def line_start(text: str, at: int) -> int:
    return text.rfind("\n", 0, at) + 1


def line_end(text: str, at: int) -> int:
    """Return where the line's end is, before its line break."""
    found = text.find("\n", at)
    return len(text) if found < 0 else found


def value_end(text: str, node: yaml.Node) -> int:
    """Return where a value ends. PyYAML's own mark of a block lies behind the comments that follow it."""
    begin, end = int(node.start_mark.index), int(node.end_mark.index)
    if is_alias(node):
        return end
    if isinstance(node, yaml.ScalarNode):
        if node.style not in ("|", ">"):
            return end
        keeps = "+" in text[begin : line_end(text, begin)].partition("#")[0]
        return end - 1 if keeps and text[end - 1 : end] == "\n" else begin + len(text[begin:end].rstrip())
    if not isinstance(node, yaml.CollectionNode) or node.flow_style or not node.value:
        return end
    last = node.value[-1]
    return value_end(text, last[1] if isinstance(node, yaml.MappingNode) else last)


def segments(text: str, node: yaml.Node) -> list[tuple[int, int]]:
    """Return where each entry of a block or a list begins (its key, its dash or itself) and ends."""
    if isinstance(node, yaml.MappingNode):
        return [(key.start_mark.index, value_end(text, value)) for key, value in node.value]
    if not isinstance(node, yaml.SequenceNode):
        return []
    if node.flow_style:
        return [(item.start_mark.index, value_end(text, item)) for item in node.value]
    found: list[tuple[int, int]] = []
    for item in node.value:
        begin = (
            _dash(text, line_end(text, found[-1][1]) + 1, node.start_mark.column) if found else node.start_mark.index
        )
        found.append((begin, max(begin + 1, value_end(text, item))))
    return found


def _dash(text: str, begin: int, column: int) -> int:
    """Return the next dash of a list, from the beginning of a line on."""
    while text[begin : begin + column].strip() or text[begin + column : begin + column + 1] != "-":
        end = line_end(text, begin)
        if end >= len(text):
            return end
        begin = end + 1
    return begin + column
