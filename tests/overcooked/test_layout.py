"""Valid grids are read in both notations; invalid ones are refused with file, row, column and remedy."""

from pathlib import Path

import pytest

from overcooked.layout import LayoutError, bundled_layout, load_layout, parse_layout

RING = "XXXPX\nX 1 P\nD2X X\nO   X\nXOSXX"
FOREIGN = '{"grid": """' + RING.replace("\n", "\n                ") + '""", %s}'
THREE_ONIONS = '"start_all_orders": [{"ingredients": ["onion", "onion", "onion"]}]'


def refused(grid: str) -> LayoutError:
    with pytest.raises(LayoutError) as refusal:
        parse_layout(grid, source="mine.layout")
    assert "mine.layout" in str(refusal.value)
    assert refusal.value.remedy in str(refusal.value)
    return refusal.value


@pytest.mark.parametrize(
    ("grid", "place", "reason"),
    [
        ("XXXPX\nX 1 P\nD2X  X\nO   X\nXOSXX", (3, 6), "the row has 6 cells, the first row has 5"),
        ("XXXPX\nX 1 P\nD2X\nO   X\nXOSXX", (3, 4), "the row has 3 cells, the first row has 5"),
        ("XXXPX\nX 1 P\nD2Z X\nO   X\nXOSXX", (3, 3), "unknown tile 'Z'"),
        ("XXXPX\nX 3 P\nD2X X\nO   X\nXOSXX", (2, 3), "unknown tile '3'"),
        ("XXXPX\nX 1 P\nD2X X\nT   X\nXOSXX", (4, 1), "tomatoes"),
        ("XX PX\nX 1 P\nD2X X\nO   X\nXOSXX", (1, 3), "the border is open"),
        ("XXXPX\nX 1 P\nD2X X\nO    \nXOSXX", (4, 5), "the border is open"),
        ("XXXPX\nX 1 P\n2DX X\nO   X\nXOSXX", (3, 1), "the border is open"),
        ("XXXPX\nX 1 P\nD2X X\nO  1X\nXOSXX", (4, 4), "player 1 starts twice"),
        ("XXXPX\nX   P\nD2X X\nO   X\nXOSXX", (None, None), "player 1 has no start cell"),
        ("XXXPX\nX 1 P\nD X X\nO   X\nXOSXX", (None, None), "player 2 has no start cell"),
        ("XXXXX\nX 1 X\nD2X X\nO   X\nXOSXX", (None, None), "there is no pot"),
        ("XXXPX\nX 1 P\nX2X X\nO   X\nXOSXX", (None, None), "there is no dish dispenser"),
        ("XXXPX\nX 1 P\nD2X X\nX   X\nXXSXX", (None, None), "there is no onion dispenser"),
        ("XXXPX\nX 1 P\nD2X X\nO   X\nXOXXX", (None, None), "there is no serving station"),
        ("XXXPX\nX 1 P\nD2X X\nO   X\nXOSXP", (5, 5), "nobody can reach this pot"),
        ("XXPXXXX\nX 1XX X\nD2X XXS\nO   XXX\nXOSXXXX", (3, 7), "nobody can reach this serving station"),
        ("", (None, None), "the grid is empty"),
        ("\n\n", (None, None), "the grid is empty"),
        ("X" * 40 + "\n" + "X" * 40, (None, None), "40 x 2 cells"),
    ],
)
def test_bad_grid_is_refused_with_its_place(grid: str, place: tuple[int | None, int | None], reason: str) -> None:
    refusal = refused(grid)
    assert reason in str(refusal)
    assert (refusal.row, refusal.column) == place
    if place[0]:
        assert f"row {place[0]}, column {place[1]}" in str(refusal)


def test_grid_keeps_its_text_and_counts_columns_first() -> None:
    layout = parse_layout(RING + "\n")
    assert layout.text == RING
    assert (layout.width, layout.height) == (5, 5)
    assert layout.starts.tolist() == [[2, 1], [1, 2]]
    assert layout.pots.tolist() == [[3, 0], [4, 1]]


def test_windows_line_ends_name_the_same_kitchen() -> None:
    assert parse_layout(RING.replace("\n", "\r\n")).sha256 == parse_layout(RING).sha256


def test_layout_arrays_cannot_be_changed() -> None:
    with pytest.raises(ValueError, match="read-only"):
        parse_layout(RING).tiles[0, 0] = 0


@pytest.mark.parametrize(
    "settings",
    [
        THREE_ONIONS,
        THREE_ONIONS + ', "rew_shaping_params": None, "cook_time": 20, "delivery_reward": 20',
        '"start_order_list": None, "num_items_for_soup": 3',
        '"recipe_times": [20], "recipe_values": [20], "start_bonus_orders": [], "start_state": None',
        '"old_dynamics": True, "layout_name": "ring", "order_bonus": 2',
        '"rew_shaping_params": {"PLACEMENT_IN_POT_REW": 3, "DISH_PICKUP_REWARD": 3, "SOUP_PICKUP_REWARD": 5}',
    ],
)
def test_dictionary_of_overcooked_ai_is_the_same_kitchen(settings: str) -> None:
    assert parse_layout(FOREIGN % settings).sha256 == parse_layout(RING).sha256


@pytest.mark.parametrize(
    ("settings", "reason"),
    [
        ('"cook_time": 5', "cook_time = 5 is not supported"),
        ('"delivery_reward": 5', "delivery_reward = 5 is not supported"),
        ('"start_all_orders": [{"ingredients": ["tomato"]}]', "only the order of three onions"),
        ('"start_all_orders": [{"ingredients": ["onion", "onion"]}]', "only the order of three onions"),
        ('"onion_value": 7', "onion_value = 7 is not supported"),
        ('"cook_time": open("x")', "row 5: something is computed"),
        ('"cook_time": }', "not a readable dictionary"),
        ('"recipe_times": [5]', "recipe_times = [5] is not supported"),
        ('"recipe_values": [3]', "recipe_values = [3] is not supported"),
        ('"cook_time": True', "cook_time = True is not supported"),
        ('"start_state": {"players": [], "objects": []}', "start_state = {"),
        ('"start_bonus_orders": [{"ingredients": ["onion"]}]', "start_bonus_orders = ["),
        ('"start_order_list": ["any"]', "start_order_list = ['any'] is not supported"),
        ('"num_items_for_soup": 2', "num_items_for_soup = 2 is not supported"),
        ('"max_num_ingredients": 2', "max_num_ingredients = 2 is not supported"),
        ('"old_dynamics": False', "old_dynamics = False is not supported"),
        ('"rew_shaping_params": {"PLACEMENT_IN_POT_REW": 9}', "rew_shaping_params = {"),
        ('"rew_shaping_params": {"OTHER": 1}', "rew_shaping_params = {"),
        ('"start_player_positions": [[1, 1], [2, 2]]', "unknown setting 'start_player_positions'"),
        ('"cooktime": 5', "unknown setting 'cooktime'"),
        ("7: 5", "unknown setting 7"),
        ('"cook_time": 5, "cook_time": 20', "a key occurs twice"),
        ('**{"cook_time": 5}', "not a readable dictionary"),
        ('"cook_time": ' + "[" * 10_000, "not a readable dictionary"),
    ],
)
def test_dictionary_of_another_kitchen_is_refused(settings: str, reason: str) -> None:
    assert reason in str(refused(FOREIGN % settings))


def test_dictionary_without_a_grid_is_refused() -> None:
    assert "no text under" in str(refused("{'start_all_orders': []}"))


def test_layout_is_loaded_from_a_file(tmp_path: Path) -> None:
    file = tmp_path / "mine.layout"
    file.write_text(RING)
    assert load_layout(file).name == "mine"
    assert load_layout(file).sha256 == load_layout("coordination_ring").sha256


@pytest.mark.parametrize("text", [RING, FOREIGN % THREE_ONIONS], ids=["drawn", "dictionary"])
def test_byte_order_mark_is_not_part_of_the_kitchen(text: str, tmp_path: Path) -> None:
    file = tmp_path / "mine.layout"
    file.write_bytes(text.encode("utf-8-sig"))
    assert load_layout(file).sha256 == parse_layout(RING).sha256
    assert parse_layout("\ufeff" + text).sha256 == parse_layout(RING).sha256


def test_file_in_another_encoding_is_refused_with_the_remedy(tmp_path: Path) -> None:
    file = tmp_path / "mine.layout"
    file.write_bytes(RING.encode("utf-16"))
    with pytest.raises(LayoutError, match=r"mine\.layout: this is not UTF-8 .* Save the file as UTF-8"):
        load_layout(file)


def test_name_out_of_a_file_is_not_a_path(tmp_path: Path) -> None:
    file = tmp_path / "mine.layout"
    file.write_text(RING)
    assert bundled_layout("coordination_ring").text == RING
    for name in (str(file), str(file.with_suffix("")), "../layouts/coordination_ring"):
        with pytest.raises(FileNotFoundError, match="there is no layout"):
            bundled_layout(name)


def test_unknown_layout_is_refused_with_the_known_names() -> None:
    with pytest.raises(FileNotFoundError, match="coordination_ring"):
        load_layout("cordination_ring")


def test_bad_file_is_named(tmp_path: Path) -> None:
    file = tmp_path / "bad.layout"
    file.write_text("XX\nXX")
    with pytest.raises(LayoutError, match=r"bad\.layout"):
        load_layout(file)
