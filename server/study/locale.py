"""The platform's words, one file per language in `locales/`. Another language is one more file, there or in the folder
`locales` next to a study (see own_languages.py).
"""

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path
from typing import Any

import yaml

LOCALES = Path(__file__).parent / "locales"
FALLBACK = "en"
_ADDED: dict[str, dict[str, str]] = {}  # words of languages from folders next to studies, and of the data folder
_REFUSED: dict[str, str] = {}  # why the file of a language cannot be used
# Words as written, where the usual loader reads `No` or `7.50` as something else; C is ten times as quick.
_LOADER = getattr(yaml, "CBaseLoader", yaml.BaseLoader)


@dataclass(frozen=True)
class Locale:
    """The words of one language. `locale("quiz.again", attempts=2)` fills in numbers; a missing word is an error."""

    language: str
    words: dict[str, str] = field(repr=False)

    @property
    def name(self) -> str:
        """The language's own name."""
        return self.words["name"]

    def __call__(self, key: str, /, **numbers: Any) -> str:
        words = self.words[key]
        return words.format(**numbers) if numbers else words

    def section(self, prefix: str) -> dict[str, str]:
        """Return all words below `prefix`, without it: what a script on the page needs."""
        start = f"{prefix}."
        return {key[len(start) :]: words for key, words in self.words.items() if key.startswith(start)}


@cache
def locale(language: str) -> Locale:
    """Return the words of a language; where a file lacks some, the English ones."""
    words = dict(_words(FALLBACK))
    words["name"] = words["name"] if language == FALLBACK else language
    words.update(_words(language) if language in languages() else {})
    return Locale(language, words)


@cache
def languages() -> tuple[str, ...]:
    """Return the platform's languages."""
    return tuple(sorted({*(path.stem for path in LOCALES.glob("*.yaml")), *_ADDED}))


def is_bundled(language: str) -> bool:
    """Return whether the platform itself has the words of a language: then no other file replaces them."""
    return (LOCALES / f"{language}.yaml").is_file()


def add_language(language: str, words: Mapping[str, str]) -> None:
    """Use these words, which were checked; the file may change later. An empty entry means the English text."""
    _ADDED[language] = {key: text for key, text in words.items() if text}
    _REFUSED.pop(language, None)
    for function in (locale, languages, _words):
        function.cache_clear()


def refuse_language(language: str, reason: str) -> None:
    """Note why the file of a language cannot be used; words that it had before stay."""
    _REFUSED[language] = reason


def refusal(language: str) -> str:
    """Return why the file of a language cannot be used; empty if there is none, or it can."""
    return _REFUSED.get(language, "")


def best_language(accepted: str, offered: tuple[str, ...]) -> str:
    """Return the offered language that an Accept-Language header prefers; the first one if none fits."""
    preferences: list[tuple[float, int, str]] = []
    for place, item in enumerate(accepted.split(",")[:20]):
        name, _, quality = item.strip().partition(";q=")
        try:
            preferences.append((-float(quality or 1), place, name.lower()))
        except ValueError:
            continue
    for _, _, name in sorted(preferences):
        for language in offered:
            if name == language.lower() or name.split("-")[0] == language.lower().split("-")[0]:
                return language
    return offered[0]


@cache
def _words(language: str) -> dict[str, str]:
    if is_bundled(language) or language not in _ADDED:
        return words_in((LOCALES / f"{language}.yaml").read_text(encoding="utf-8"))
    return _ADDED[language]


def words_in(text: str) -> dict[str, str]:
    """Return the words of a file by key, as they are written. Raises yaml.YAMLError, AttributeError."""
    return dict(_flat(yaml.load(text, Loader=_LOADER), ""))  # noqa: S506 a safe one


def _flat(data: dict[str, Any], prefix: str) -> list[tuple[str, str]]:
    pairs: list[tuple[str, str]] = []
    for key, value in data.items():
        name = f"{prefix}{key}"
        pairs.extend(_flat(value, f"{name}.") if isinstance(value, dict) else [(name, str(value))])
    return pairs
