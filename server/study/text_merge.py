"""Three-way merge of texts, line by line: combine two people's changes to a common base."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from difflib import SequenceMatcher
from typing import Final

_MAX_EXACT_LINES: Final = 500  # lines; in longer texts, frequent lines are not anchors, or a merge takes minutes


@dataclass(frozen=True)
class TextConflict:
    """A place that both changed differently: whole lines of each text."""

    theirs: str
    mine: str


@dataclass(frozen=True)
class _Edit:
    """Lines `start` to `end` of the base become `lines`."""

    start: int
    end: int
    lines: tuple[str, ...]
    is_mine: bool

    @property
    def is_in_place(self) -> bool:
        """Return whether lines were only changed, none added or removed."""
        return len(self.lines) == self.end - self.start

    def meets(self, other: "_Edit") -> bool:
        """Return whether the edits overlap, or are adjacent so that order or indentation could change the meaning.
        Changes of two neighbouring lines do not meet."""
        if self.is_in_place and other.is_in_place:
            return self.start < other.end and other.start < self.end
        return self.start <= other.end and other.start <= self.end


def merged(base: str, theirs: str, mine: str) -> list[str | TextConflict]:
    """Return the text with the changes of both, in parts: a conflict for each place where they contradict. Without a
    conflict the parts are one text."""
    lines = base.splitlines(keepends=True)
    edits = [*_edits(lines, theirs, False), *_edits(lines, mine, True)]
    parts: list[str | TextConflict] = []
    done = 0
    for group in _groups(sorted(edits, key=lambda edit: (edit.start, edit.is_in_place, edit.end))):
        start, end = group[0].start, max(edit.end for edit in group)
        _append(parts, "".join(lines[done:start]))
        theirs_here = _applied(lines, (start, end), [edit for edit in group if not edit.is_mine])
        mine_here = _applied(lines, (start, end), [edit for edit in group if edit.is_mine])
        unchanged = "".join(lines[start:end])
        if theirs_here == mine_here or mine_here == unchanged:
            _append(parts, theirs_here)
        elif theirs_here == unchanged:
            _append(parts, mine_here)
        else:
            parts.append(TextConflict(theirs_here, mine_here))
        done = end
    _append(parts, "".join(lines[done:]))
    return parts


def _edits(base: Sequence[str], text: str, is_mine: bool) -> Iterator[_Edit]:
    lines = text.splitlines(keepends=True)
    matcher = SequenceMatcher(None, base, lines, autojunk=len(lines) > _MAX_EXACT_LINES)
    for kind, start, end, first, last in matcher.get_opcodes():
        if kind == "replace" and end - start == last - first:
            for place, line in zip(range(start, end), lines[first:last], strict=True):
                yield _Edit(place, place + 1, (line,), is_mine)
        elif kind != "equal":
            yield _Edit(start, end, tuple(lines[first:last]), is_mine)


def _groups(edits: Sequence[_Edit]) -> Iterator[list[_Edit]]:
    """Yield groups of edits that meet one of the other side, with all that these meet; each other edit alone. `edits`:
    by place."""
    group: list[_Edit] = []
    for edit in edits:
        if any(one.is_mine is not edit.is_mine and edit.meets(one) for one in group):
            group.append(edit)
            continue
        if group:
            yield group
        group = [edit]
    if group:
        yield group


def _applied(base: Sequence[str], place: tuple[int, int], edits: Sequence[_Edit]) -> str:
    done, end = place
    found: list[str] = []
    for edit in edits:
        found += [*base[done : edit.start], *edit.lines]
        done = edit.end
    return "".join([*found, *base[done:end]])


def _append(parts: list[str | TextConflict], text: str) -> None:
    """Add a text to the one before it."""
    if parts and isinstance(parts[-1], str):
        parts[-1] += text
    elif text:
        parts.append(text)
