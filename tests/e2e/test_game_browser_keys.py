"""Keys, fingers and absences on the game's page, with a server that records the messages."""

import pytest
from playwright.sync_api import Browser, Page

from server.play.messages import Away, Countdown, Ended, Input, Paused, Ready
from tests.support.browser.fake_game_server import FakeGameServer, kitchen, tick, welcome
from tests.support.browser.game_page import PHONE, opened, settled, start
from tests.support.browser.pressed_keys import moves, press_raw, taps, were_sent
from tests.support.browser.pressed_keys import page as page
from tests.support.parameters import mostly_slow


def test_a_held_key_sends_one_message_and_its_release_another(page: Page, server: FakeGameServer) -> None:
    page.keyboard.down("ArrowRight")
    for _ in range(5):  # what a keyboard does when a key is held: down again, marked as repeated
        page.keyboard.down("ArrowRight")
    page.keyboard.up("ArrowRight")
    server.wait_for(lambda server: len(server.inputs()) == 2)
    assert moves(server) == [(2, 2), (None, None)]


def test_a_tap_between_two_ticks_is_sent_as_exactly_one_tap(page: Page, server: FakeGameServer) -> None:
    for count in range(1, 11):
        page.keyboard.press("ArrowUp", delay=30 if count == 1 else 0)
    server.wait_for(lambda server: len(server.inputs()) == 20)
    assert moves(server) == [(0, 0), (None, None)] * 10


def test_more_keys_than_a_timestep_can_use_wait_for_the_next_one_and_only_the_latest_are_sent(
    page: Page, server: FakeGameServer
) -> None:
    for _ in range(30):
        page.keyboard.press("ArrowUp")
        page.keyboard.press("Space")
    page.keyboard.down("ArrowLeft")
    settled(page, server)
    sent = len(server.inputs())
    assert 20 <= sent < 40
    server.send(tick(kitchen(t=2)))
    server.wait_for(lambda server: len(server.inputs()) > sent + 1)
    assert moves(server)[sent:] == [(3, 5), (3, 3)], "the last use, the last turn, and what is held now"
    assert [each.seq for each in server.inputs()] == list(range(1, sent + 3))
    server.send(tick(kitchen(t=3)))
    page.keyboard.up("ArrowLeft")
    were_sent(page, server, lambda server: moves(server)[sent + 2 :], [(None, None)])


def test_a_release_that_waits_is_told_when_the_keys_go_elsewhere(page: Page, server: FakeGameServer) -> None:
    for _ in range(30):
        page.keyboard.press("ArrowUp")
    page.keyboard.down("ArrowUp")
    settled(page, server)
    server.send(tick(kitchen(t=2)))
    page.wait_for_selector("[data-timestep='2']")
    for _ in range(30):
        page.keyboard.press("Space")
    page.keyboard.up("ArrowUp")
    assert moves(server)[-1][0] == 0, "as far as the server knows it is held"
    page.focus("#sound")
    server.wait_for(lambda server: moves(server)[-1] == (None, None))
    settled(page, server)
    assert moves(server)[-1] == (None, None)


def test_waiting_keys_are_forgotten_when_the_game_is_paused(page: Page, server: FakeGameServer) -> None:
    for _ in range(30):
        page.keyboard.press("ArrowUp")
    settled(page, server)
    sent = len(server.inputs())
    server.send(Paused("researcher", 30.0))
    page.wait_for_selector("[data-view=pause]")
    server.send(Countdown(0), tick(kitchen(t=2)))
    page.wait_for_selector("[data-timestep='2']")
    page.keyboard.press("Space")
    server.wait_for(lambda server: len(server.inputs()) > sent)
    assert moves(server)[sent:] == [(None, 5)]


def test_every_change_has_a_new_number_and_the_time_of_the_browser(page: Page, server: FakeGameServer) -> None:
    page.keyboard.press("KeyW")
    page.keyboard.press("Space")
    server.wait_for(lambda server: len(server.inputs()) == 3)
    found = server.inputs()
    assert [each.seq for each in found] == [1, 2, 3]
    assert [each.client_ms for each in found] == sorted(each.client_ms for each in found)


def test_letters_and_enter_do_what_arrows_and_space_do(page: Page, server: FakeGameServer) -> None:
    for key in ("KeyW", "KeyS", "KeyD", "KeyA"):
        page.keyboard.press(key)
    for key in ("KeyE", "Enter"):
        page.keyboard.press(key)
    server.wait_for(lambda server: len(server.inputs()) == 10)
    assert [each.tap for each in server.inputs() if each.tap is not None] == [0, 1, 2, 3, 5, 5]


def test_leaving_the_window_releases_all_keys_and_pauses(page: Page, server: FakeGameServer) -> None:
    page.keyboard.down("ArrowLeft")
    page.evaluate("window.dispatchEvent(new Event('blur'))")
    server.wait_for(lambda server: bool(server.of(Away)))
    page.keyboard.up("ArrowLeft")
    assert moves(server) == [(3, 3), (None, None)]
    assert server.of(Away) == [Away("blur")]
    server.send(Paused("blur", 30.0))
    page.wait_for_selector("[data-view=pause]")
    page.keyboard.press("ArrowLeft")
    page.evaluate("window.dispatchEvent(new Event('focus'))")
    server.wait_for(lambda server: len(server.of(Ready)) == 2)
    assert len(server.inputs()) == 2, "no key counts while the game is paused, none acts afterwards"


def test_a_hidden_page_says_so_and_comes_back_by_itself(page: Page, server: FakeGameServer) -> None:
    hide = """Object.defineProperty(document, 'hidden', {configurable: true, value: %s});
      document.dispatchEvent(new Event('visibilitychange'))"""
    page.evaluate(hide % "true")
    server.wait_for(lambda server: server.of(Away) == [Away("hidden")])
    server.send(Paused("hidden", 25.0))
    page.evaluate(hide % "false")
    server.wait_for(lambda server: len(server.of(Ready)) == 2)
    assert server.of(Away) == [Away("hidden")], "said once"
    assert server.inputs() == []


def test_keys_reach_the_game_but_never_scroll_the_page(page: Page, server: FakeGameServer) -> None:
    page.evaluate("window.stopped = []; addEventListener('keydown', (event) => stopped.push(event.defaultPrevented))")
    page.keyboard.press("ArrowDown")
    page.keyboard.press("Space")
    page.keyboard.press("Control+ArrowDown")
    page.focus("#sound")
    page.keyboard.press("ArrowDown")
    server.wait_for(lambda server: len(server.inputs()) == 3)
    assert page.evaluate("stopped") == [True, True, False, False, False], (
        "space, arrows; then Control, its arrow, another element"
    )
    assert len(server.inputs()) == 3


def test_no_key_counts_before_the_start_or_after_the_end(chromium: Browser, server: FakeGameServer) -> None:
    with opened(chromium, server) as page:
        page.wait_for_selector("[data-phase=ready]")
        page.keyboard.press("ArrowDown")
        start(page, server)
        page.keyboard.press("ArrowUp")
        server.wait_for(lambda server: len(server.inputs()) == 2)
        server.send(Ended(0, 0, 0.0, True, "/blank", "horizon"))
        page.wait_for_selector("[data-phase=ended]")
        page.keyboard.press("ArrowUp")
        settled(page, server)
        assert [each.tap for each in server.inputs()] == [0, None]


def test_the_own_chef_turns_before_the_server_answers(page: Page, server: FakeGameServer) -> None:
    server.send(tick(kitchen(t=2)))
    page.wait_for_selector("[data-timestep='2']")
    before = page.evaluate("document.querySelector('canvas.board').toDataURL()")
    page.keyboard.down("ArrowLeft")
    page.wait_for_function("(before) => document.querySelector('canvas.board').toDataURL() !== before", arg=before)
    assert page.get_attribute(".game", "data-timestep") == "2"


def test_two_fingers_walk_and_use_at_once(chromium: Browser, server: FakeGameServer) -> None:
    with opened(chromium, server, viewport=PHONE, has_touch=True, is_mobile=True) as page:
        start(page, server)
        middle = {}
        for action in (0, 2, 5):
            box = page.locator(f".touch [data-action='{action}']").bounding_box()
            assert box is not None
            assert min(box["width"], box["height"]) >= 48
            middle[action] = {"x": box["x"] + box["width"] / 2, "y": box["y"] + box["height"] / 2}
        fingers = page.context.new_cdp_session(page)

        def touch(kind: str, *points: dict[str, float]) -> None:
            numbered = [{**point, "id": number} for number, point in enumerate(points)]
            fingers.send("Input.dispatchTouchEvent", {"type": kind, "touchPoints": numbered})

        touch("touchStart", middle[0])
        touch("touchStart", middle[0], middle[5])
        touch("touchEnd", middle[0])
        touch("touchMove", middle[2])
        touch("touchEnd")
        server.wait_for(lambda server: len(server.inputs()) >= 5)
        assert moves(server) == [(0, 0), (0, 5), (None, None), (2, 2), (None, None)], "slid from up to right"


@pytest.mark.slow
def test_the_pad_works_without_a_pointer(chromium: Browser, server: FakeGameServer) -> None:
    with opened(chromium, server, viewport=PHONE, has_touch=True, is_mobile=True) as page:
        start(page, server)
        page.evaluate("document.querySelector('.touch [data-action=\"5\"]').click()")
        server.wait_for(lambda server: bool(server.inputs()))
        settled(page, server)
        assert moves(server) == [(None, 5)], "once, and nothing is held"


def test_keys_pressed_during_the_countdown_reach_the_server(chromium: Browser, server: FakeGameServer) -> None:
    server.welcome = welcome()
    with opened(chromium, server) as page:
        page.click("#start-button")
        server.wait_for(lambda server: bool(server.of(Ready)))
        server.send(Countdown(3))
        page.wait_for_selector("[data-view=count]")
        page.keyboard.down("ArrowUp")
        server.wait_for(lambda server: bool(server.of(Input)))
        assert moves(server) == [(0, 0)], "a key held into the start counts from the first timestep on"


@pytest.mark.parametrize("modifier", mostly_slow(["Meta", "Control", "Alt"]))
def test_a_key_up_that_a_modifier_swallows_does_not_leave_the_chef_walking(
    page: Page, server: FakeGameServer, modifier: str
) -> None:
    page.keyboard.down("ArrowLeft")
    page.keyboard.down(modifier)  # on macOS, no key-up of another key is sent while Cmd is down
    server.wait_for(lambda server: moves(server) == [(3, 3), (None, None)])
    page.keyboard.up(modifier)
    press_raw(page, "keydown", code="ArrowLeft", key="ArrowLeft", repeat=True)  # but it is still held down
    server.wait_for(lambda server: len(server.inputs()) == 3)
    settled(page, server)
    assert moves(server) == [(3, 3), (None, None), (3, None)]
    page.keyboard.up("ArrowLeft")
    were_sent(page, server, lambda server: moves(server)[3:], [(None, None)])


def test_a_key_whose_repeats_stop_is_released(page: Page, server: FakeGameServer) -> None:
    page.keyboard.down("ArrowRight")
    for _ in range(4):
        page.keyboard.down("ArrowRight")
    server.wait_for(lambda server: moves(server) == [(2, 2), (None, None)])
    page.keyboard.down("ArrowRight")  # it was late only
    server.wait_for(lambda server: len(server.inputs()) >= 3)
    assert moves(server)[2] == (2, None)


def test_a_key_that_goes_down_twice_counts_twice(page: Page, server: FakeGameServer) -> None:
    for _ in range(2):  # the key-up between them got lost
        press_raw(page, "keydown", code="Space", key=" ")
    were_sent(page, server, taps, [5, 5])


def test_a_menu_over_the_game_releases_the_keys(page: Page, server: FakeGameServer) -> None:
    page.keyboard.down("ArrowUp")
    page.evaluate("document.querySelector('.stage').dispatchEvent(new MouseEvent('contextmenu', {bubbles: true}))")
    were_sent(page, server, moves, [(0, 0), (None, None)])


@pytest.mark.slow
def test_dragging_something_over_the_game_releases_the_keys(page: Page, server: FakeGameServer) -> None:
    page.keyboard.down("ArrowUp")
    page.evaluate("document.querySelector('.stage').dispatchEvent(new DragEvent('dragstart', {bubbles: true}))")
    were_sent(page, server, moves, [(0, 0), (None, None)])


def test_every_dialog_releases_the_keys(page: Page, server: FakeGameServer) -> None:
    page.evaluate("document.activeElement.blur()")  # in Safari a click on a button takes the focus nowhere
    page.keyboard.down("ArrowLeft")
    page.evaluate("document.querySelector('#keys-dialog').showModal()")
    were_sent(page, server, moves, [(3, 3), (None, None)])


@pytest.mark.slow
def test_a_mouse_button_whose_release_was_swallowed_holds_nothing(page: Page, server: FakeGameServer) -> None:
    page.set_viewport_size(PHONE)
    page.evaluate("document.querySelector('.touch').style.display = 'flex'")
    right = page.locator(".touch [data-action='2']").bounding_box()
    assert right is not None
    pressed = "{ bubbles: true, pointerId: 1, pointerType: 'mouse', isPrimary: true, buttons: 1 }"
    page.evaluate(
        f"document.querySelector('.touch [data-action]').dispatchEvent(new PointerEvent('pointerdown', {pressed}))"
    )
    server.wait_for(lambda server: moves(server) == [(0, 0)])
    page.mouse.move(right["x"] + 20, right["y"] + 20)  # with no button down
    were_sent(page, server, lambda server: moves(server)[1:], [(None, None)])
