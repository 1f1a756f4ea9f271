"""A study that is being written: its values for a form, its problems with their places, and changes from a form."""

import re
import secrets
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Final

from server.study import yaml_edit
from server.study.loader import PlacedProblem, StudyError, StudyFile, parse_study, values_of
from server.study.yaml_edit import YamlEditError

STUDY_NAME: Final = re.compile(r"[a-z][a-z0-9_-]{0,39}")
MAX_CHARACTERS: Final = 300_000
_HEAD: Final = re.compile(r"\A(#.*\n)+")


@dataclass(frozen=True)
class DraftView:
    """The editor's view of a text. `values` is None if the text is not YAML, `file` if it is not yet a study."""

    values: dict[str, Any] | None
    problems: tuple[PlacedProblem, ...]
    file: StudyFile | None = None


def view(text: str, source: str = "the draft") -> DraftView:
    """Parse and check a text as the loader does."""
    try:
        values = values_of(text)
    except StudyError as error:
        return DraftView(None, _placed(error))
    try:
        file = parse_study(text, source)
    except StudyError as error:
        return DraftView(values, _placed(error))
    return DraftView(values, file.placed_warnings, file)


def _placed(error: StudyError) -> tuple[PlacedProblem, ...]:
    return error.placed or tuple(PlacedProblem(1, (), line) for line in error.lines)


def changed(text: str, operation: Any) -> str:
    """Apply a change from the form: {"do": "put", "path": [...], "value": ...}, or remove, keep, insert, move, rename.
    A value of null removes the key; `keep` leaves only these items of a list.

    Raises StudyError for a text that cannot be read, YamlEditError for a change that cannot be made.
    """
    try:
        what, path = operation["do"], _path(operation["path"])
        match what:
            case "put" if operation["value"] in (None, "") and not yaml_edit.has(text, path):
                return text  # an empty field of a missing block
            case "put" if operation["value"] is None:
                return yaml_edit.remove(text, path)
            case "put":
                return yaml_edit.put(text, path, operation["value"], plain=operation.get("plain") is True)
            case "remove":
                return yaml_edit.remove(text, path)
            case "keep":
                return yaml_edit.keep(text, path, [int(index) for index in operation["items"]])
            case "insert":
                return yaml_edit.insert(text, path, int(operation["index"]), operation["value"])
            case "move":
                return yaml_edit.move(text, path, int(operation["index"]), int(operation["to"]))
            case "rename":
                return yaml_edit.rename(text, path, str(operation["key"]))
    except (KeyError, TypeError, ValueError, IndexError, RecursionError) as error:
        if isinstance(error, YamlEditError | StudyError):
            raise
        raise YamlEditError("Invalid change. Reload the page.") from None
    raise YamlEditError("Unknown change. Reload the page.")


def _path(pieces: Any) -> Sequence[str | int]:
    if not isinstance(pieces, list) or not all(isinstance(piece, str | int) for piece in pieces):
        raise YamlEditError("this change names no place. Reload the page.")
    return tuple(pieces)


def from_template(text: str, name: str, title: str) -> str:
    """Return a template as a study of its own, with another seed. The template's first comment describes the
    template."""
    text = _HEAD.sub(f"# The study {name}.\n", text.replace("\r\n", "\n"))
    text = yaml_edit.put(text, ("name",), name)
    text = yaml_edit.put(text, ("seed",), secrets.randbelow(10**9))
    if not title:
        return text
    languages = values_of(text).get("languages") or ["en"]
    return yaml_edit.put(text, ("title",), dict.fromkeys(languages, title))


def named(text: str) -> str:
    """Return the study's name in the text; empty if there is no valid one."""
    try:
        name = values_of(text).get("name")
    except StudyError:
        return ""
    return name if isinstance(name, str) and STUDY_NAME.fullmatch(name) else ""
