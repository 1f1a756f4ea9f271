"""Two people's changes to one text are merged; no text of either is lost."""

from hypothesis import given
from hypothesis import strategies as st

from server.study.text_merge import TextConflict, merged

BASE = "name: pilot\nduration_min: 30\nseed: 1\nflow:\n  - introduction\n  - episodes\n  - thanks\n"
Texts = st.lists(st.sampled_from("abcde"), max_size=8).map(lambda lines: "".join(f"{line}\n" for line in lines))


def both(theirs: str, mine: str) -> list[str | TextConflict]:
    return merged(BASE, theirs, mine)


def test_changes_in_different_places_become_one_text() -> None:
    theirs = BASE.replace("name: pilot", "name: main")
    mine = BASE.replace("  - episodes", "  - quiz\n  - episodes")
    assert both(theirs, mine) == [mine.replace("pilot", "main")]


def test_other_words_in_neighbouring_lines_are_not_a_conflict() -> None:
    theirs, mine = BASE.replace("30", "31"), BASE.replace("seed: 1", "seed: 2")
    assert both(theirs, mine) == [BASE.replace("30", "31").replace("seed: 1", "seed: 2")]


def test_the_same_change_of_both_is_made_once() -> None:
    changed = BASE.replace("  - episodes\n", "  - quiz\n  - episodes\n")
    assert both(changed, changed) == [changed]


def test_two_values_of_one_line_are_a_conflict_and_the_rest_is_merged() -> None:
    theirs = BASE.replace("30", "31").replace("thanks", "survey")
    mine = BASE.replace("30", "32").replace("pilot", "main")
    end = "seed: 1\nflow:\n  - introduction\n  - episodes\n  - survey\n"
    assert both(theirs, mine) == ["name: main\n", TextConflict("duration_min: 31\n", "duration_min: 32\n"), end]


def test_a_line_that_one_removes_and_the_other_changes_is_a_conflict() -> None:
    theirs, mine = BASE.replace("  - episodes\n", ""), BASE.replace("- episodes", "- games")
    assert TextConflict("", "  - games\n") in both(theirs, mine)


def test_lines_that_both_add_at_one_place_are_a_conflict_as_their_order_is_unknown() -> None:
    theirs, mine = (BASE.replace("  - thanks", f"  - {page}\n  - thanks") for page in ("one", "two"))
    assert TextConflict("  - one\n", "  - two\n") in both(theirs, mine)


def test_a_line_added_next_to_one_that_was_removed_is_a_conflict_as_it_may_belong_to_it() -> None:
    theirs = BASE.replace("  - episodes\n", "")
    mine = BASE.replace("  - episodes\n", "  - episodes\n    title: Rounds\n")
    assert TextConflict("", "  - episodes\n    title: Rounds\n") in both(theirs, mine)


@given(Texts, Texts, Texts)
def test_each_side_can_be_read_out_of_the_parts_where_the_other_changed_nothing(base: str, one: str, two: str) -> None:
    assert "".join(map(str, merged(base, one, base))) == one
    assert "".join(map(str, merged(base, base, two))) == two
    assert "".join(map(str, merged(base, one, one))) == one


@given(Texts, Texts, Texts)
def test_the_merge_does_not_depend_on_the_order(base: str, one: str, two: str) -> None:
    turned = [
        TextConflict(part.mine, part.theirs) if isinstance(part, TextConflict) else part
        for part in merged(base, two, one)
    ]
    assert turned == merged(base, one, two)


@given(Texts, st.lists(st.sampled_from("xyz"), max_size=3), st.lists(st.sampled_from("uvw"), max_size=3), st.data())
def test_every_line_that_somebody_added_is_in_the_text_or_in_a_conflict(
    base: str, hers: list[str], his: list[str], data: st.DataObject
) -> None:
    def with_lines(added: list[str]) -> str:
        lines = base.splitlines(keepends=True)
        for line in added:
            lines.insert(data.draw(st.integers(0, len(lines))), f"{line}\n")
        return "".join(lines)

    parts = merged(base, with_lines(hers), with_lines(his))
    found = "".join(part if isinstance(part, str) else part.theirs + part.mine for part in parts)
    assert all(found.count(line) >= (hers + his).count(line) for line in {*hers, *his})


def test_long_texts_of_few_different_lines_do_not_keep_the_server_busy() -> None:
    parts = merged("a\nb\n" * 4000, "b\na\n" * 4000, "a\na\nb\n" * 3000)
    assert "".join(part if isinstance(part, str) else part.mine for part in parts) == "a\na\nb\n" * 3000
