"""The game's scripts that are independent of the page: state, arrows, keys, messages. They run in a browser."""

import itertools
import json
from typing import Any

import pytest
from playwright.sync_api import Page

from server.play import messages
from tests.support.browser.fake_game_server import RING, kitchen, tick, welcome

pytestmark = [pytest.mark.browser, pytest.mark.timeout(90)]


def run(page: Page, module: str, body: str, argument: Any = None) -> Any:
    """What `body` returns; in it `m` is the module and `a` the argument."""
    script = f"async ([path, a]) => {{ const m = await import(path); {body} }}"
    return page.evaluate(script, [f"/static/js/{module}.js", argument])


def wire(message: messages.Outgoing) -> dict[str, Any]:
    decoded: dict[str, Any] = json.loads(messages.encode(message))
    return decoded


def marks(page: Page, prediction: Any, watched: Any, other: Any, grid: Any = RING) -> list[dict[str, Any]]:
    found: list[dict[str, Any]] = run(page, "board/marks", "return m.marks(...a)", [prediction, watched, other, grid])
    return found


P3 = [[0, 95], [0, 80], [5, 60]]


def test_moves_into_free_cells_carry_the_estimate_on(blank: Page) -> None:
    # From (1, 3) north twice along the left corridor, then use what is ahead: the counter at (1, 0).
    first, second, third = marks(blank, P3, [1, 3, 0, 0], [3, 3, 0, 0])
    assert (first["kind"], first["x"], first["y"], first["direction"]) == ("move", 1, 3, 0)
    assert (second["kind"], second["x"], second["y"]) == ("move", 1, 2)
    assert (third["kind"], third["x"], third["y"]) == ("hand", 1, 0)


def test_marks_shrink_and_fade_with_every_step(blank: Page) -> None:
    found = marks(blank, P3, [1, 3, 0, 0], [3, 3, 0, 0])
    assert [mark["size"] for mark in found] == [1, 0.85, 0.7]
    assert [mark["opacity"] for mark in found] == [0.95, 0.8, 0.6]


def test_a_counter_ahead_makes_a_blunt_arrow_and_the_estimate_stays(blank: Page) -> None:
    first, second, _ = marks(blank, [[3, 95], [5, 80], [4, 60]], [1, 1, 0, 0], [3, 3, 0, 0])
    assert (first["kind"], first["x"], first["y"], first["direction"]) == ("blunt", 1, 1, 3)
    assert (second["kind"], second["x"], second["y"]) == ("hand", 0, 1), "the hand lies on the newly faced cell"


def test_the_other_chef_blocks_at_its_current_cell(blank: Page) -> None:
    first, second, _ = marks(blank, [[0, 95], [2, 80], [4, 60]], [1, 2, 0, 0], [1, 1, 0, 0])
    assert first["kind"] == "blunt"
    assert (second["kind"], second["direction"]) == ("blunt", 2), "the counter in the middle of the ring"


def test_waiting_in_one_place_is_one_ring(blank: Page) -> None:
    found = marks(blank, [[4, 95], [4, 80], [4, 60]], [1, 1, 0, 0], [3, 3, 0, 0])
    assert [(mark["kind"], mark["count"]) for mark in found] == [("ring", 3), ("none", 1), ("none", 1)]


def test_arrows_between_the_same_cells_are_moved_apart(blank: Page) -> None:
    first, second, _ = marks(blank, [[1, 95], [0, 80], [6, 60]], [1, 1, 0, 0], [3, 3, 0, 0])
    (there, _), (start, turn, back) = first["points"], second["points"]
    assert there[0] < 1 < turn[0], "each on the right of its own way"
    assert start[0] == there[0], "the second starts where the first ends"
    assert turn[0] == back[0]


def test_an_action_that_is_not_shown_makes_a_mark_of_no_kind(blank: Page) -> None:
    found = marks(blank, [[6, 95], [6, 80], [6, 60]], [1, 1, 0, 0], [3, 3, 0, 0])
    assert [mark["kind"] for mark in found] == ["none"] * 3, "the same path runs in every condition"


def test_a_step_that_comes_nearer_keeps_its_name_and_glides(blank: Page) -> None:
    before = marks(blank, [[0, 95], [0, 80], [2, 60]], [1, 3, 0, 0], [3, 3, 0, 0])
    after = marks(blank, [[0, 95], [2, 80], [2, 60]], [1, 2, 0, 0], [3, 3, 0, 0])
    assert after[0]["id"] == before[1]["id"]
    halfway = run(blank, "board/marks", "return m.eased(a[1], a[0], 50, false)", [before, after])
    assert before[1]["size"] < halfway[0]["size"] * halfway[0]["grown"] < after[0]["size"]
    assert (halfway[0]["shown"], halfway[2]["shown"]) == (1, 0.5), "only a new mark fades in"
    done = run(blank, "board/marks", "return m.eased(a[1], a[0], m.FADE_MS, false)", [before, after])
    assert done == after
    assert run(blank, "board/marks", "return m.FADE_MS") <= 100


def test_a_prediction_is_stale_after_two_ticks(blank: Page) -> None:
    assert run(blank, "board/marks", "return [m.isStale(0, 400, 200), m.isStale(0, 401, 200)]") == [False, True]


def states(page: Page, outgoing: list[messages.Outgoing], body: str, times: list[float] | None = None) -> Any:
    """`s` is the state after all messages, each at its time in ms."""
    apply = "let s = m.defaults(); a[0].forEach((message, i) => { s = m.apply(s, message, a[1][i]); }); "
    return run(page, "board/state", apply + body, [[wire(each) for each in outgoing], times or [0.0] * len(outgoing)])


def test_chefs_glide_from_cell_to_cell_within_a_tick(blank: Page) -> None:
    moved = kitchen(t=1, players=((3, 1, 2, 0), (1, 2, 0, 0)))
    body = "return [0, 60, 120, 180, 400].map((t) => m.place(s, 0, 1000 + t)[0])"
    places = states(blank, [welcome(), tick(moved)], body, [0, 1000])
    assert places[0] == 2
    assert places == sorted(places)
    assert places[-2:] == [3, 3], "there within 180 ms"
    assert places[1] - places[0] > places[3] - places[2], "quick at first"


def test_no_picture_of_sixty_a_second_moves_a_chef_by_more_than_a_third_of_a_cell(blank: Page) -> None:
    moved = kitchen(t=1, players=((3, 1, 2, 0), (1, 2, 0, 0)))
    body = "return [...Array(30).keys()].map((k) => m.place(s, 0, 1000 + k * 1000 / 60)[0])"
    places = states(blank, [welcome(), tick(moved)], body, [0, 1000])
    assert max(later - earlier for earlier, later in itertools.pairwise(places)) <= 0.35


def test_a_chef_continues_from_its_drawn_position_when_a_tick_arrives_early(blank: Page) -> None:
    one, two = (kitchen(t=t, players=((2 + t, 1, 2, 0), (1, 2, 0, 0))) for t in (1, 2))
    body = "return m.place(s, 0, 1090)[0]"
    seen = states(blank, [welcome(), tick(one), tick(two)], body, [0, 1000, 1090])
    assert 2 < seen < 3


def test_a_chef_is_put_not_glided_after_a_gap(blank: Page) -> None:
    far = kitchen(t=50, players=((1, 3, 2, 0), (3, 3, 0, 0)))
    assert states(blank, [welcome(), tick(far)], "return m.place(s, 0, 1000)", [0, 1000]) == [1, 3]


def test_the_own_chef_turns_at_once_until_the_server_answers(blank: Page) -> None:
    body = """
      const turned = m.applyTurn(s, 3, 7);
      const early = m.apply(turned, {...a[0][1], applied: 6}, 10), late = m.apply(turned, {...a[0][1], applied: 7}, 10);
      return [m.facing(s, 0), m.facing(turned, 0), m.facing(turned, 1), m.facing(early, 0), m.facing(late, 0)];
    """
    assert states(blank, [welcome(), tick(kitchen(t=1))], body) == [0, 3, 0, 3, 0]


def test_apply_leaves_the_old_state_as_it_is(blank: Page) -> None:
    body = "const old = JSON.stringify(s); m.apply(s, a[0][1], 5); return old === JSON.stringify(s)"
    assert states(blank, [welcome(), tick(kitchen(t=1))], body) is True


def test_the_time_left_comes_from_the_timestep(blank: Page) -> None:
    assert states(blank, [welcome(), tick(kitchen(t=195))], "return m.secondsLeft(s)") == 41
    endless = welcome(kind="tutorial", endless=True, horizon=0)
    assert states(blank, [endless], "return m.secondsLeft(s)") is None


def test_the_state_shown_during_the_countdown_does_not_start_the_game(blank: Page) -> None:
    outgoing: list[messages.Outgoing] = [welcome(), messages.Countdown(3), tick(kitchen(t=0))]
    assert states(blank, outgoing, "return s.phase") == "countdown"
    assert states(blank, [*outgoing, tick(kitchen(t=1))], "return s.phase", [0, 0, 0, 3200]) == "playing"


def test_a_timestep_that_was_being_made_when_the_game_paused_does_not_end_the_pause(blank: Page) -> None:
    came_back: list[messages.Outgoing] = [welcome(resumed=True), messages.Paused("lost", 60.0), tick(kitchen(t=13))]
    body = "return [s.phase, s.current.t, s.pause?.reason, s.pause?.fresh]"
    assert states(blank, came_back, body) == ["paused", 13, "lost", True]
    assert states(blank, [*came_back, messages.Paused("lost", 59.0)], body) == ["paused", 13, "lost", True]
    goes_on = [*came_back, messages.Countdown(3), tick(kitchen(t=14))]
    assert states(blank, goes_on, "return s.phase", [0, 0, 0, 0, 3200]) == "playing"


def test_a_timestep_that_was_still_to_be_stored_does_not_cut_the_countdown_short(blank: Page) -> None:
    """After a database that was away, and after `ready` in the middle of a commit, it follows on the countdown."""
    goes_on = [welcome(resumed=True), messages.Paused("database", 0.0), messages.Countdown(3), tick(kitchen(t=13))]
    body = "return [s.phase, s.current.t, s.countdown?.seconds]"
    assert states(blank, goes_on, body, [0, 0, 1000, 1010]) == ["countdown", 13, 3]
    started = [*goes_on, tick(kitchen(t=14))]
    assert states(blank, started, body, [0, 0, 1000, 1010, 4200]) == ["playing", 14, None]


def keys(page: Page, body: str) -> Any:
    return run(page, "game/input", "const k = new m.Keys(); " + body)


def test_the_last_key_pressed_wins_and_the_one_before_comes_back(blank: Page) -> None:
    found = keys(blank, "return [k.press('ArrowUp'), k.press('KeyD'), k.release('KeyD'), k.release('ArrowUp')]")
    assert found == [
        {"held": 0, "tap": 0},
        {"held": 2, "tap": 2},
        {"held": 0, "tap": None},
        {"held": None, "tap": None},
    ]


def test_use_is_a_tap_and_never_held(blank: Page) -> None:
    found = keys(blank, "return [k.press('Space'), k.held, k.press('Space'), k.release('Space')]")
    assert found == [{"held": None, "tap": 5}, None, None, None]


def test_use_while_walking_keeps_the_walk(blank: Page) -> None:
    assert keys(blank, "k.press('ArrowLeft'); return k.press('KeyE')") == {"held": 3, "tap": 5}


def test_releasing_a_key_under_another_changes_nothing(blank: Page) -> None:
    assert keys(blank, "k.press('ArrowUp'); k.press('ArrowLeft'); return [k.release('ArrowUp'), k.held]") == [None, 3]


def test_clear_releases_all_keys_with_one_message(blank: Page) -> None:
    found = keys(blank, "k.press('ArrowUp'); return [k.clear(), k.clear(), k.release('ArrowUp')]")
    assert found == [{"held": None, "tap": None}, None, None]


def test_a_key_given_to_another_action_loses_its_old_meaning(blank: Page) -> None:
    found = run(
        blank,
        "game/keys-dialog",
        "return m.rebind((await import('/static/js/game/input.js')).DEFAULT_BINDINGS, '0', 'KeyI')",
    )
    assert found["0"] == ["KeyI"]
    swapped = run(
        blank,
        "game/keys-dialog",
        "return m.rebind((await import('/static/js/game/input.js')).DEFAULT_BINDINGS, '0', 'KeyS')",
    )
    assert (swapped["0"], swapped["1"]) == (["KeyS"], ["ArrowDown"])


def every_message() -> list[messages.Outgoing]:
    return [
        welcome(),
        messages.Waiting(172.0),
        messages.Countdown(3),
        tick(kitchen(t=1)),
        messages.Paused("lost", 21.5),
        messages.Lesson("fetch", 1, 7, False),
        messages.Ended(20, 1, 3.0, True, "/s/quick_look/now", "horizon"),
        messages.Ping(5),
        messages.Notice("Hello"),
        messages.Refused("not_now", "too early"),
        messages.Superseded(),
    ]


@pytest.mark.parametrize("message", every_message(), ids=lambda message: type(message).__name__)
def test_every_message_of_the_server_is_understood(blank: Page, message: messages.Outgoing) -> None:
    assert run(blank, "game/messages", "return m.parse(a)", messages.encode(message).decode()) == wire(message)


def test_no_message_of_the_server_is_forgotten() -> None:
    assert {type(message) for message in every_message()} == set(messages.Outgoing.__args__)  # type: ignore[attr-defined]


def test_a_message_with_a_wrong_field_is_refused_by_name(blank: Page) -> None:
    broken = {**wire(tick(kitchen(t=1))), "actions": [1]}
    words = run(
        blank, "game/messages", "try { m.parse(a); } catch (error) { return error.message; }", json.dumps(broken)
    )
    assert words == "tick: bad field actions"


def test_what_the_browser_builds_the_server_decodes(blank: Page) -> None:
    body = """return [m.hello('abcdefgh1', -1), m.ready(), m.input(1, 2, 2, 10.5), m.input(2, null, null, 11),
      m.away('blur'), m.pong(3), m.clientError('x'.repeat(900))].map((each) => JSON.stringify(each))"""
    found = [messages.decode(frame) for frame in run(blank, "game/messages", body)]
    assert {type(message) for message in found} == set(messages.Incoming.__args__)  # type: ignore[attr-defined]
    assert found[2] == messages.Input(1, 2, 2, 10.5)


def test_retries_come_quickly_then_slower_and_never_all_at_once(blank: Page) -> None:
    delays = run(
        blank, "game/connection", "return Array.from({length: 12}, (_, i) => [m.retryDelay(i, 0), m.retryDelay(i, 1)])"
    )
    assert delays[0][1] <= 200
    assert max(high for _, high in delays) <= 2000, "back within three seconds of the server"
    assert all(high == 2 * low for low, high in delays)


def test_a_duplicated_tab_gets_a_name_of_its_own_and_a_reload_keeps_it(blank: Page) -> None:
    body = """
      const kept = new Map(), hidden = new EventTarget();
      const getItem = (k) => kept.get(k) ?? null;
      const setItem = (k, v) => kept.set(k, v), removeItem = (k) => kept.delete(k);
      const storage = { getItem, setItem, removeItem };
      const first = m.tabName(storage, hidden), copy = m.tabName({ ...storage, setItem() {} }, new EventTarget());
      hidden.dispatchEvent(new Event('pagehide'));
      return [first, copy, m.tabName(storage, new EventTarget())];
    """
    first, copy, reloaded = run(blank, "game/connection", body)
    assert first == reloaded != copy
    assert len(first) >= 16


def test_what_happened_is_read_from_two_states(blank: Page) -> None:
    before = kitchen(t=7, players=((3, 3, 1, 1), (2, 3, 1, 3)), pots=((3, 0, 3, 19),))
    after = kitchen(
        t=8, players=((3, 3, 1, 0), (2, 3, 1, 0)), pots=((3, 0, 3, 20),), counters=((3, 4, 1),), score=20, soups=1
    )
    states_json = [json.loads(messages.encode(tick(state)))["state"] for state in (before, after)]
    found = run(blank, "board/events", "return m.events(a[0], a[1], [5, 5], a[2])", [*states_json, RING])
    assert {(event["kind"], event["x"], event["y"]) for event in found} == {
        ("put", 3, 4),
        ("delivery", 2, 4),
        ("ready", 3, 0),
    }
