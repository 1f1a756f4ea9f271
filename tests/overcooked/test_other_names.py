"""Layouts are found by the names that overcooked_ai and older papers use, and keep one name in the data."""

import pytest

from overcooked.layout import LAYOUT_FOLDER, bundled_layout, layout_names, load_layout
from overcooked.other_names import OTHER_NAMES


@pytest.mark.parametrize(("other", "name"), OTHER_NAMES.items())
def test_a_layout_is_found_by_its_other_name(other: str, name: str) -> None:
    assert load_layout(other).name == bundled_layout(other).name == name
    assert load_layout(other).sha256 == load_layout(name).sha256


def test_every_other_name_stands_for_a_bundled_layout_and_hides_none() -> None:
    assert set(OTHER_NAMES.values()) <= set(layout_names())
    assert not set(OTHER_NAMES) & {path.stem for path in LAYOUT_FOLDER.iterdir()}
