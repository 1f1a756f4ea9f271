"""The platform's words: complete in every language, and the right one chosen."""

import re
import string
from pathlib import Path

import pytest

from server.study.locale import _words, best_language, languages, locale

ROOT = Path(__file__).parents[3]
OTHERS = [language for language in languages() if language != "en"]


def placeholders(words: str) -> set[str]:
    return {name for _, name, _, _ in string.Formatter().parse(words) if name}


def test_english_and_chinese_are_there() -> None:
    assert {"en", "zh"} <= set(languages())


@pytest.mark.parametrize("language", OTHERS)
def test_language_has_all_words_with_the_same_numbers_in_them(language: str) -> None:
    english, other = _words("en"), _words(language)
    assert set(other) == set(english)
    for key, words in english.items():
        assert placeholders(other[key]) == placeholders(words), key


@pytest.mark.parametrize("language", OTHERS)
def test_language_translates_every_sentence(language: str) -> None:
    english, other = locale("en").words, locale(language).words
    same = [key for key, words in english.items() if other[key] == words and " " in words]
    assert same == []


def test_chinese_has_one_word_for_the_code_of_those_who_finish_and_one_for_that_of_all_others() -> None:
    words = locale("zh").words
    assert words["thanks.code"] == "你的完成码"
    assert words["thanks.return_code"] == "你的提前结束码"
    studies = [path.read_text(encoding="utf-8") for path in (ROOT / "studies").rglob("*.yaml")]
    for text in (*words.values(), *studies):
        assert "完成代码" not in text
        assert "返回代码" not in text


def test_words_of_a_language_are_shown_as_they_were_written(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "xx.yaml").write_text("name: No\ndone: 7.50\nback: 1:30\nnext: 007\nskip: null\n", encoding="utf-8")
    monkeypatch.setattr("server.study.locale.LOCALES", tmp_path)
    assert _words.__wrapped__("xx") == {"name": "No", "done": "7.50", "back": "1:30", "next": "007", "skip": "null"}


def test_every_text_that_a_template_uses_exists() -> None:
    used = set()
    for path in (ROOT / "templates").rglob("participant/*.html"):
        used |= set(re.findall(r"""\bt\(["']([\w.]+)["'][,)]""", path.read_text("utf-8")))
    used |= set(re.findall(r"""\bt\(["']([\w.]+)["'][,)]""", (ROOT / "templates/base.html").read_text("utf-8")))
    assert len(used) > 40
    assert used - set(locale("en").words) == set()


@pytest.mark.parametrize(
    ("accepted", "language"),
    [
        ("zh-CN,zh;q=0.9,en;q=0.8", "zh"),
        ("de,en;q=0.5", "en"),
        ("fr", "en"),
        ("", "en"),
        ("en;q=0.1,zh;q=0.2", "zh"),
        ("zh;q=broken,en", "en"),
    ],
)
def test_best_language_is_what_the_browser_wants_most(accepted: str, language: str) -> None:
    assert best_language(accepted, ("en", "zh")) == language


def test_missing_word_is_an_error() -> None:
    with pytest.raises(KeyError):
        locale("en")("no.such.word")
