"""Additional languages: the platform's words in the folder `locales` next to a study, such as `locales/de.yaml`."""

import json
import re
import string
from collections.abc import Iterator
from dataclasses import dataclass
from itertools import takewhile
from pathlib import Path
from typing import Final

import yaml

from server.study.locale import FALLBACK, LOCALES, add_language, is_bundled, words_in

FOLDER: Final = "locales"
LANGUAGE: Final = re.compile(r"[a-z]{2,3}(-[A-Za-z0-9]{2,8})*")
_MAX_BYTES: Final = 500_000
INDENT: Final = "  "


class LanguageError(ValueError):
    """A language file that cannot be used. `lines` has one sentence per problem, each with its place and remedy."""

    def __init__(self, lines: list[str]) -> None:
        self.lines = tuple(lines)
        super().__init__("\n".join(lines))


@dataclass(frozen=True)
class Completeness:
    """The texts that a language file lacks, and obsolete ones that the platform does not use. English words by
    key."""

    missing: dict[str, str]
    obsolete: tuple[str, ...]


def language_file(folder: Path, language: str) -> Path:
    """Return the path of a language file, for studies in a folder."""
    return folder / FOLDER / f"{language}.yaml"


def template(language: str) -> str:
    """Return a file of words to translate: the English next to each empty entry."""
    head = (
        f"# The platform's words in {language}. Write each translation between the quotes, next to the English.\n"
        "# Keep {words in braces}: they are filled in. An empty entry is shown in English.\n"
        "# `name` is what the language calls itself.\n"
    )
    lines: list[str] = []
    above: tuple[str, ...] = ()
    for key, words in _english().items():
        *blocks, name = key.split(".")
        same = sum(1 for _ in takewhile(lambda pair: pair[0] == pair[1], zip(blocks, above, strict=False)))
        if same < len(above) and not blocks[same:]:
            lines.append("")
        for depth in range(same, len(blocks)):
            lines += ([""] if depth == 0 else []) + [f"{INDENT * depth}{blocks[depth]}:"]
        lines.append(f'{INDENT * len(blocks)}{name}: ""  # {_one_line(words)}')
        above = tuple(blocks)
    return head + "\n".join(lines) + "\n"


def _english() -> dict[str, str]:
    return words_in((LOCALES / f"{FALLBACK}.yaml").read_text(encoding="utf-8"))


def _path_to(line: str, above: list[tuple[int, str]]) -> list[tuple[int, str]]:
    """Return the keys that lead to a line, with their indents, from those that led to the line before."""
    key = re.match(r"( *)([a-z0-9_]+):", line)
    if key is None:
        return above
    indent = len(key[1])
    return [*(one for one in above if one[0] < indent), (indent, key[2])]


def _one_line(words: str) -> str:
    return words if "\n" not in words else json.dumps(words, ensure_ascii=False)


def completeness(path: Path) -> Completeness:
    """Compare a file of words with the English ones. Raises LanguageError, OSError."""
    words, english = read(path), _english()
    missing = {key: text for key, text in english.items() if not words.get(key)}
    return Completeness(missing, tuple(key for key in words if key not in english))


def read(path: Path) -> dict[str, str]:
    """Return the words of a file by key. Raises LanguageError with place and remedy, OSError."""
    if path.stat().st_size > _MAX_BYTES:
        raise LanguageError([f"{path}:1: the file has more than {_MAX_BYTES:,} bytes. Keep the words only."])
    try:
        text = path.read_text(encoding="utf-8")
        words = words_in(text)
    except UnicodeDecodeError:
        raise LanguageError([f"{path}:1: this is not UTF-8. Save the file as UTF-8."]) from None
    except yaml.MarkedYAMLError as error:
        line = error.problem_mark.line + 1 if error.problem_mark else 1
        reason = f"this is not valid YAML: {error.problem}. Put words that hold one of : # {{ }} in quotes."
        raise LanguageError([f"{path}:{line}: {reason}"]) from None
    except (yaml.YAMLError, AttributeError, TypeError, RecursionError):
        remedy = f"Make one with `kitchenmind study words {path.stem}`."
        raise LanguageError([f"{path}:1: this is not a file of words. {remedy}"]) from None
    if wrong := list(_wrong_braces(path, text, words)):
        raise LanguageError(wrong)
    return words


def _wrong_braces(path: Path, text: str, words: dict[str, str]) -> Iterator[str]:
    """Check that the placeholders are the same as in English, as a page would fail otherwise."""
    english = _english()
    for key, translated in words.items():
        wanted = _placeholders(english.get(key, ""))
        if translated and key in english and _placeholders(translated) != wanted:
            names = ", ".join(f"{{{name}}}" for name in sorted(wanted or ())) or "no braces"
            reason = f"{key}: the words in braces differ from the English ones"
            yield f"{path}:{_line_of(text, key)}: {reason}. Use {names}."


def _placeholders(words: str) -> set[str] | None:
    """Return the placeholders; None if the braces cannot be parsed."""
    try:
        return {
            f"{name}{'!' * bool(how)}{form}"
            for _, name, form, how in string.Formatter().parse(words)
            if name is not None
        }
    except ValueError:
        return None


def _line_of(text: str, key: str) -> int:
    above: list[tuple[int, str]] = []
    for number, line in enumerate(text.splitlines(), start=1):
        above = _path_to(line, above)
        if ".".join(name for _, name in above) == key:
            return number
    return 1


def use_languages_next_to(folder: Path) -> None:
    """Use the languages in the folder `locales` next to a study. The platform's own languages stay as they are. Raises
    LanguageError."""
    for path in language_files(folder):
        add_language(path.stem, read(path))


def language_files(folder: Path) -> list[Path]:
    """Return the files of languages that the platform does not have itself."""
    found = sorted((folder / FOLDER).glob("*.yaml"))
    return [path for path in found if LANGUAGE.fullmatch(path.stem) and not is_bundled(path.stem)]
