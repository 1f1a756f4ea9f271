"""Load a study file. All problems are reported at once, each with file, line, reason and remedy."""

import hashlib
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from functools import lru_cache
from pathlib import Path as FilePath
from typing import Any

import yaml
from pydantic import ValidationError

from server.study.branch_checks import branch_problems
from server.study.checks import Path, Problem, problems
from server.study.definition import Study
from server.study.display_checks import display_problems
from server.study.factor_checks import factor_problems, in_factors
from server.study.own_languages import LanguageError, use_languages_next_to
from server.study.plan_checks import plan_problems
from server.study.quick_fixes import QuickFix
from server.study.recruitment_checks import recruitment_problems
from server.study.validation_messages import problems_of

MAX_BYTES = 1_000_000
MAX_NODES = 50_000
MAX_KEPT = 32_000  # characters of a text whose nodes are kept: they take 9 MB at the most
DEEPEST = 20  # blocks and lists inside one another
_TOO_MUCH = f"more than {DEEPEST} levels inside one another, or more than {MAX_NODES:,} values"
_TAG = "tag:yaml.org,2002:"
_SCALARS = frozenset({"str", "int", "float", "bool", "null", "timestamp"})
_NULLS = frozenset({"", "~", "null", "Null", "NULL"})


@dataclass(frozen=True)
class PlacedProblem:
    """A problem (or warning) in a text, with its place and remedy. `path`: as far as the text has it."""

    line: int
    path: Path
    text: str
    warning: bool = False
    fix: QuickFix | None = None


class StudyError(ValueError):
    """A study file that cannot be used. `lines` has one sentence a problem, each naming its place and remedy; `placed`
    has the same for an editor, where the places are known."""

    def __init__(self, lines: Sequence[str], placed: Sequence[PlacedProblem] = ()) -> None:
        self.lines, self.placed = tuple(lines), tuple(placed)
        super().__init__("\n".join(self.lines))


@dataclass(frozen=True)
class StudyFile:
    """A study with the file it comes from. `sha256` of the bytes is its version; `warnings` do not stop it."""

    study: Study
    source: str
    text: str
    sha256: str
    places: "LineNumbers"
    warnings: tuple[str, ...] = ()
    folder: FilePath = field(default_factory=FilePath.cwd)
    """Where relative paths of models start."""
    own_models: FilePath | None = None
    """Where trained models that the study names are: KITCHEN/NAME below this folder."""
    placed_warnings: tuple[PlacedProblem, ...] = ()
    """The warnings with their places."""

    def describe(self, problem: Problem) -> str:
        """Return `file:line: reason. remedy`, as all errors read."""
        return self.places.describe(problem)


class LineNumbers:
    """The line of each value in a file."""

    def __init__(self, source: str) -> None:
        self.source = source
        self._lines: dict[Path, int] = {}

    def put(self, path: Path, line: int) -> None:
        self._lines[path] = line

    def line(self, path: Path) -> int:
        """Return the line (from 1) of a value, or of the nearest block around it."""
        while path not in self._lines and path:
            path = path[:-1]
        return self._lines.get(path, 1)

    def nearest(self, path: Path) -> Path:
        """Return the path as far as the file has it, without pydantic's own entries (the type of a question)."""
        known: Path = ()
        for piece in path:
            if (*known, piece) in self._lines:
                known = (*known, piece)
        made_by_factors = not known and path[:1] == ("conditions",) and ("factors",) in self._lines
        return ("factors",) if made_by_factors else known

    def describe(self, problem: Problem) -> str:
        path = self.nearest(problem.path)
        place = ".".join(str(piece) for piece in path)
        where = f"{self.source}:{self.line(path)}: "
        return f"{where}{place + ': ' if place else ''}{self._sentence(problem)}"

    def placed(self, problem: Problem) -> PlacedProblem:
        """Return the same for an editor."""
        path = self.nearest(problem.path)
        return PlacedProblem(self.line(path), path, self._sentence(problem), problem.warning, problem.fix)

    def error(self, found: Sequence[Problem]) -> StudyError:
        """Return all problems as one error."""
        return StudyError([self.describe(one) for one in found], [self.placed(one) for one in found])

    @staticmethod
    def _sentence(problem: Problem) -> str:
        return f"{problem.reason.rstrip('.')}. {problem.remedy}".rstrip()


def load_study(path: str | FilePath, models_folder: FilePath | None = None) -> StudyFile:
    """Return the study in a file, with the languages next to it. `models_folder`: where relative paths of models start,
    if not in the file's folder. Raises StudyError (all problems at once), FileNotFoundError."""
    file = FilePath(path)
    try:
        data = file.read_bytes()
    except FileNotFoundError:
        remedy = "Check the path, or make a study file: `kitchenmind study new NAME --out FILE`."
        raise FileNotFoundError(f"{path}: No such file. {remedy}") from None
    if len(data) > MAX_BYTES:
        raise StudyError([f"{path}:1: the file has {len(data):,} bytes. At most {MAX_BYTES:,} are read."])
    try:
        use_languages_next_to(file.parent)
    except LanguageError as error:
        raise StudyError(error.lines) from None
    try:
        return replace(parse_study(data.decode("utf-8"), str(path)), folder=(models_folder or file.parent).absolute())
    except UnicodeDecodeError as error:
        line = data[: error.start].count(b"\n") + 1
        raise StudyError([f"{path}:{line}: this is not UTF-8. Save the file as UTF-8."]) from None


def parse_study(text: str, source: str = "study.yaml") -> StudyFile:
    """Return the study written in `text`. Raises StudyError."""
    places = LineNumbers(source)
    data = _read(text, places)
    try:
        study = Study.model_validate(data)
    except ValidationError as error:
        found = sorted(problems_of(error, places.nearest), key=lambda one: places.line(one.path))
        raise places.error(found) from None
    of_parts = (
        *problems(study),
        *recruitment_problems(study),
        *display_problems(study),
        *plan_problems(study),
        *branch_problems(study),
    )
    together = (*factor_problems(study), *in_factors(study, of_parts))
    found = sorted(together, key=lambda one: places.line(places.nearest(one.path)))
    wrong = [problem for problem in found if not problem.warning]
    if wrong:
        raise places.error(wrong)
    warnings = tuple(places.describe(problem) for problem in found if problem.warning)
    placed_warnings = tuple(places.placed(problem) for problem in found if problem.warning)
    digest = hashlib.sha256(text.encode()).hexdigest()
    return StudyFile(study, source, text, digest, places, warnings, placed_warnings=placed_warnings)


def values_of(text: str | yaml.Node) -> Any:
    """Return the values that stand in a text (or below a node of it): texts, lists and blocks, not yet checked. Raises
    StudyError."""
    places = LineNumbers("study.yaml")
    return _read(text, places) if isinstance(text, str) else _Reader(places).value(text, ())


def _read(text: str, places: LineNumbers) -> Any:
    return _Reader(places).value(compose(text, places.source), ())


def compose(text: str, source: str, loader: "type[StudyComposer] | None" = None) -> yaml.MappingNode:
    """Return the nodes of a text. Raises StudyError."""
    composed: Callable[[str, Any], Any] = _kept if len(text) <= MAX_KEPT else yaml.compose
    try:
        root = composed(text, loader or StudyComposer)
    except yaml.MarkedYAMLError as error:
        mark = error.problem_mark or error.context_mark
        line = mark.line + 1 if mark else 1
        reason = f"this is not YAML: {error.problem}. {_yaml_remedy(error.problem or '')}"
        raise _unplaced(source, line, reason) from None
    except yaml.YAMLError as error:
        reason = f"this is not YAML: {error}. Save the file as plain UTF-8 text."
        raise _unplaced(source, 1, reason) from None
    if not isinstance(root, yaml.MappingNode):
        reason = "a study is a mapping of keys. Start from `kitchenmind study new NAME`."
        raise _unplaced(source, 1, reason)
    return root


@lru_cache(maxsize=8)
def _kept(text: str, loader: Any) -> Any:
    """Return the nodes of one of the last texts; nobody may change them. The server reads the same text again and
    again, e.g. for each change in the study builder, and PyYAML takes 6 to 18 ms for that of a bundled study."""
    return yaml.compose(text, Loader=loader)


def _unplaced(source: str, line: int, reason: str) -> StudyError:
    return StudyError([f"{source}:{line}: {reason}"], [PlacedProblem(line, (), reason)])


class StudyComposer(yaml.BaseLoader):
    """Nodes with their text as written (the field decides the type of a value), within limits on depth and size."""

    def __init__(self, stream: Any) -> None:
        super().__init__(stream)
        self._depth = self._composed = 0

    def compose_node(self, parent: yaml.Node | None, index: Any) -> yaml.Node | None:
        self._depth += 1
        self._composed += 1
        if self._depth > DEEPEST + 1 or self._composed > MAX_NODES:
            event: Any = self.peek_event()  # type: ignore[no-untyped-call]
            raise yaml.MarkedYAMLError(problem=_TOO_MUCH, problem_mark=event.start_mark)
        node = super().compose_node(parent, index)
        self._depth -= 1
        return node


def _yaml_remedy(problem: str) -> str:
    if problem == _TOO_MUCH:
        return "Write a flatter or shorter file."
    if "\\t" in problem or "tab" in problem:
        return "Indent with spaces, not tabs."
    if "but got '?'" in problem or "expected ',' or '}'" in problem:
        return "Put words that hold one of : ? , { } [ ] in quotes."
    return "Check indentation, colons and quotes in this line and the one above."


class _Reader:
    """Texts, lists and blocks from YAML nodes, with their lines; duplicate keys and alias bombs are refused. A value
    stays a text as in the file, so `1:30`, `007`, `7.50` and `no` are shown as written, and a field for a number or
    true/false parses the text itself.
    """

    def __init__(self, places: LineNumbers) -> None:
        self._places = places
        self._nodes = 0

    def value(self, node: yaml.Node, path: Path) -> Any:
        self._nodes += 1
        line = node.start_mark.line + 1
        self._places.put(path, line)
        if self._nodes > MAX_NODES or len(path) > DEEPEST:
            self._refuse(line, "the file is nested too deep or its aliases unfold to too much", "Write the values out.")
        if isinstance(node, yaml.MappingNode):
            return self._mapping(node, path)
        if isinstance(node, yaml.SequenceNode):
            return [self.value(item, (*path, index)) for index, item in enumerate(node.value)]
        if node.tag.removeprefix(_TAG) not in _SCALARS:
            self._refuse(line, f"the tag {node.tag} is not allowed", "Remove it.")
        is_null = node.tag == f"{_TAG}null" or (getattr(node, "style", None) is None and node.value in _NULLS)
        return None if is_null else str(node.value)

    def _mapping(self, node: yaml.MappingNode, path: Path) -> dict[str, Any]:
        result: dict[str, Any] = {}
        for key_node, value_node in node.value:
            if not isinstance(key_node, yaml.ScalarNode):
                self._refuse(key_node.start_mark.line + 1, "a key is a list or a block", "Write a word as the key.")
            key, line = str(key_node.value), key_node.start_mark.line + 1
            if key in result:
                self._refuse(line, f"the key {key!r} occurs twice in this block", "Keep only one of the two.")
            result[key] = self.value(value_node, (*path, key))
            self._places.put((*path, key), line)
        return result

    def _refuse(self, line: int, reason: str, remedy: str) -> Any:
        raise _unplaced(self._places.source, line, f"{reason}. {remedy}")
