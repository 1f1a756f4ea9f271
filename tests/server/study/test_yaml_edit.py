"""Changes to a study's YAML change exactly the requested bytes."""

import difflib
from collections.abc import Iterator
from pathlib import Path
from random import Random
from typing import Any

import pytest

from server.study import yaml_values
from server.study.loader import values_of
from server.study.yaml_edit import YamlEditError, insert, keep, move, put, remove, rename

ROOT = Path(__file__).parents[3]
FILES = sorted([*(ROOT / "studies").glob("*.yaml"), *(ROOT / "tests" / "data").glob("*.yaml")])
TEXTS = {file.name: file.read_text("utf-8") for file in FILES}
SMALL = """\
# A study.
name: small   # its name
title: {en: One, zh: 一}  # in both languages
conditions:
  # the first
  - {name: none, predictor: none}
  # the second
  - name: tom
    predictor: tom   # shown
languages: [en, zh]
later:
future_key: {kept: yes}   # nobody knows it
pages:
  end:
    body: |
      # A heading

      Words.

    title: "Quoted: yes"

flow: [introduction,
       thanks]
"""


def places(value: Any, path: tuple[str | int, ...] = ()) -> Iterator[tuple[tuple[str | int, ...], Any]]:
    """Every value of a study with its path."""
    yield path, value
    children = value.items() if isinstance(value, dict) else enumerate(value) if isinstance(value, list) else ()
    for key, child in children:
        yield from places(child, (*path, key))


def changed_lines(old: str, new: str) -> list[str]:
    lines = difflib.unified_diff(old.splitlines(), new.splitlines(), n=0, lineterm="")
    return [line for line in lines if line[:1] in "+-" and line[:3] not in ("+++", "---")]


@pytest.mark.parametrize("name", TEXTS)
def test_what_is_put_again_as_it_is_changes_no_byte(name: str) -> None:
    text = TEXTS[name]
    values = values_of(text)
    assert put(text, (), values) == text
    for path, value in list(places(values))[::31]:
        assert put(text, path, value) == text, path


@pytest.mark.parametrize("name", TEXTS)
def test_every_word_can_be_changed_and_changes_nothing_else(name: str) -> None:
    text, chance = TEXTS[name], Random(name)
    words = [
        "other",
        "no",
        "12",
        "a: b",
        "x # y",
        "- z",
        "{",
        "two\nlines",
        '"',
        "它",
        "",
        " blank ",
        "@",
        "1:30",
        "*a",
    ]
    leaves = [path for path, value in places(values_of(text)) if path and not isinstance(value, dict | list)]
    for path in chance.sample(leaves, min(8, len(leaves))):
        word = chance.choice(words)
        made = put(text, path, word)
        assert values_of(made) == yaml_values.put(values_of(text), path, word)
        kept = {line.partition("#")[2] for line in text.splitlines() if line.lstrip().startswith("#")}
        assert kept == {line.partition("#")[2] for line in made.splitlines() if line.lstrip().startswith("#")} & kept


@pytest.mark.parametrize("name", TEXTS)
def test_lists_and_blocks_can_be_changed_in_every_way(name: str) -> None:
    text, chance = TEXTS[name], Random(name)
    inner = [(path, value) for path, value in places(values_of(text)) if isinstance(value, dict | list) and value]
    for path, value in chance.sample(inner, min(6, len(inner))):
        if isinstance(value, dict):
            put(text, (*path, "new_key"), {"a": "1", "b": ["x", {"y": "long words " * 20}]})
            remove(text, (*path, chance.choice(list(value))))
            rename(text, (*path, chance.choice(list(value))), "another")
        else:
            insert(text, path, chance.randint(0, len(value)), {"name": "new", "text": {"en": "two\nlines\n"}})
            remove(text, (*path, chance.randrange(len(value))))
            there, to = chance.randrange(len(value)), chance.randrange(len(value))
            assert sorted(move(text, path, there, to)) == sorted(text), "every letter is still there"


def test_a_change_touches_its_own_line_only() -> None:
    assert changed_lines(SMALL, put(SMALL, ("name",), "other")) == [
        "-name: small   # its name",
        "+name: other   # its name",
    ]
    assert changed_lines(SMALL, put(SMALL, ("title", "zh"), "二, 三")) == [
        "-title: {en: One, zh: 一}  # in both languages",
        '+title: {en: One, zh: "二, 三"}  # in both languages',
    ]
    assert changed_lines(SMALL, put(SMALL, ("conditions", 1, "weight"), 2)) == ["+    weight: 2"]
    assert changed_lines(SMALL, put(SMALL, ("seed",), "18446744073709551616", plain=True)) == [
        "+seed: 18446744073709551616"
    ]
    assert changed_lines(SMALL, put(SMALL, ("pages", "end", "title"), "Other: no")) == [
        '-    title: "Quoted: yes"',
        '+    title: "Other: no"',
    ]
    assert changed_lines(SMALL, put(SMALL, ("pages", "end", "body"), "# A heading\n\nMore words.\n")) == [
        "-      Words.",
        "+      More words.",
    ]
    assert changed_lines(SMALL, put(SMALL, ("later",), "now")) == ["-later:", "+later: now"]
    assert changed_lines(SMALL, put(SMALL, ("later", "inside"), 1)) == ["-later:", "+later: {inside: 1}"]
    assert changed_lines(SMALL, remove(SMALL, ("flow", 0))) == [
        "-flow: [introduction,",
        "-       thanks]",
        "+flow: [thanks]",
    ]


def test_an_item_moves_with_its_comment() -> None:
    made = move(SMALL, ("conditions",), 1, 0)
    assert made.index("# the second") < made.index("name: tom") < made.index("name: none")
    assert "predictor: tom   # shown" in made


def test_an_item_is_added_to_an_empty_list_and_removed_again() -> None:
    text = "a: []\nb: 1\n"
    added = insert(text, ("a",), 0, {"name": "x", "text": "two\nlines"})
    assert values_of(added) == {"a": [{"name": "x", "text": "two\nlines"}], "b": "1"}
    assert remove(added, ("a", 0)) == text


def test_items_that_are_kept_keep_their_comments() -> None:
    kept = keep(SMALL, ("conditions",), [1])
    assert values_of(kept)["conditions"] == [{"name": "tom", "predictor": "tom"}]
    assert "  # the second\n  - name: tom\n    predictor: tom   # shown\n" in kept
    assert "predictor: none" not in kept
    with pytest.raises(YamlEditError):
        keep(SMALL, ("title",), [0])


def test_what_stands_at_another_place_is_not_changed_through_an_alias() -> None:
    text = "a: &shared {x: 1}\nb: *shared\nc: {d: *shared}\n"
    for path in (("a", "x"), ("b", "x"), ("c", "d", "x")):
        with pytest.raises(YamlEditError, match="in the YAML"):
            put(text, path, 2)
    assert values_of(put(text, ("b",), 5)) == {"a": {"x": "1"}, "b": "5", "c": {"d": {"x": "1"}}}
    assert put(text, ("c", "e"), 5).splitlines()[2] == "c: {d: *shared, e: 5}"


def test_a_key_gets_another_name_but_none_that_is_there() -> None:
    assert "  finish:\n" in rename(SMALL, ("pages", "end"), "finish")
    with pytest.raises(YamlEditError, match="already"):
        rename(SMALL, ("name",), "title")


def test_a_path_that_is_gone_is_refused() -> None:
    with pytest.raises(YamlEditError, match="Reload the page"):
        remove(SMALL, ("conditions", 7))
    with pytest.raises(YamlEditError, match="not a list"):
        insert(SMALL, ("title",), 0, "x")


@pytest.mark.parametrize(("words", "kept"), [("3", "3"), ("0.5", "0.5"), ("true", "true"), ("tea", "tea")])
def test_a_number_is_not_quoted_in_a_block_that_is_made_for_it(words: str, kept: str) -> None:
    changed = put(SMALL, ("attention", "screen_out_after"), words, plain=True)
    assert changed.splitlines()[-1] == f"attention: {{screen_out_after: {kept}}}"
