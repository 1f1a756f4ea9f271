"""Keyboards on the game's page: custom keys, other layouts, labels, and unusable keys."""

import pytest
from playwright.sync_api import Browser, Page, expect

from tests.support.browser.fake_game_server import FakeGameServer
from tests.support.browser.game_page import DESKTOP, opened, screenshot, start
from tests.support.browser.pressed_keys import moves, press_raw, taps, were_sent
from tests.support.browser.pressed_keys import page as page

pytestmark = [pytest.mark.browser, pytest.mark.timeout(90)]


def close_keys_dialog(page: Page) -> None:
    """The kitchen has the keyboard a moment after the dialog is closed: the browser first gives it to the link."""
    page.click("#keys-dialog .btn:not(.quiet)")
    expect(page.locator(".stage")).to_be_focused()


def test_own_keys_are_kept_in_this_browser(chromium: Browser, server: FakeGameServer) -> None:
    with opened(chromium, server, viewport=DESKTOP) as page:
        start(page, server)
        page.click("#change-keys")
        page.click("[data-rebind='0']")
        page.keyboard.press("KeyI")
        close_keys_dialog(page)
        assert page.inner_text(".panel.kb kbd[data-action='0']") == "I"
        page.keyboard.press("KeyI")
        page.keyboard.press("ArrowUp")
        server.wait_for(lambda server: len(server.inputs()) == 2)
        assert moves(server) == [(0, 0), (None, None)]
        page.reload()
        page.wait_for_selector("[data-phase=ready]")
        assert page.inner_text(".panel.kb kbd[data-action='0']") == "I"


@pytest.mark.slow
def test_the_number_pad_walks_and_uses(page: Page, server: FakeGameServer) -> None:
    for key in ("Numpad8", "Numpad2", "Numpad6", "Numpad4", "NumpadEnter"):
        page.keyboard.press(key)
    were_sent(page, server, taps, [0, 1, 2, 3, 5])


def test_a_keyboard_that_sends_no_codes_plays_by_its_characters(page: Page, server: FakeGameServer) -> None:
    for key in ("ArrowUp", "s", "D", "Left", " ", "Enter", "Unidentified", "q"):
        press_raw(page, "keydown", code="", key=key)
        press_raw(page, "keyup", code="", key="Unidentified")
    server.wait_for(lambda server: taps(server) == [0, 1, 2, 3, 5, 5])
    assert moves(server)[-1] == (None, 5), "nothing is held now"


UNUSABLE = (
    *(("ControlLeft", "Control"), ("AltRight", "AltGraph"), ("MetaLeft", "Meta"), ("ShiftLeft", "Shift")),
    *(("CapsLock", "CapsLock"), ("F5", "F5"), ("ContextMenu", "ContextMenu"), ("Lang1", "HangulMode")),
    *(("", "Unidentified"), ("", ""), ("Unidentified", "Process"), ("MediaPlayPause", "MediaPlayPause")),
)


def test_a_key_that_the_game_could_not_use_is_not_taken(chromium: Browser, server: FakeGameServer) -> None:
    with opened(chromium, server, viewport=DESKTOP) as page:
        start(page, server)
        page.click("#change-keys")
        page.click("[data-rebind='0']")
        for code, key in UNUSABLE:
            press_raw(page, "keydown", code=code, key=key, ctrlKey=key == "Control", altKey=key == "AltGraph")
            assert page.inner_text("#keys-note").startswith("This key cannot be used."), (code, key)
            assert page.inner_text("[data-rebind='0']") == "Press a key …", "it still waits for one"
        assert page.evaluate("localStorage.getItem('kitchenmind.keys')") is None
        page.keyboard.press("KeyI")
        assert page.inner_text("[data-rebind='0']") == "I"
        assert page.inner_text("#keys-note") == ""


def test_every_key_that_is_taken_works(chromium: Browser, server: FakeGameServer) -> None:
    with opened(chromium, server, viewport=DESKTOP) as page:
        start(page, server)
        codes = ("KeyI", "Digit7", "Numpad5", "NumpadAdd", "NumpadEnter", "Quote", "Delete", "IntlBackslash")
        for count, code in enumerate(codes, start=1):
            page.click("#change-keys")
            page.click("[data-rebind='5']")
            press_raw(page, "keydown", code=code, key="x")
            press_raw(page, "keyup", code=code, key="x")
            close_keys_dialog(page)
            press_raw(page, "keydown", code=code, key="x")
            press_raw(page, "keyup", code=code, key="x")
            server.wait_for(lambda server, count=count: len(taps(server)) >= count)  # type: ignore[misc]
            assert taps(server) == [5] * count, code


@pytest.mark.slow
def test_stored_keys_that_do_not_work_are_replaced_by_the_usual_ones(chromium: Browser, server: FakeGameServer) -> None:
    with opened(chromium, server, viewport=DESKTOP) as page:
        stored = '{"0": [""], "1": ["ControlLeft"], "2": ["KeyW"], "3": "KeyA", "5": ["Space", 7]}'
        page.evaluate("(stored) => localStorage.setItem('kitchenmind.keys', stored)", stored)
        page.reload()
        start(page, server)
        for key in ("ArrowUp", "KeyW", "ArrowDown", "ArrowLeft", "Space"):
            page.keyboard.press(key)
        were_sent(page, server, taps, [0, 2, 1, 3, 5])


AZERTY = {"KeyW": "z", "KeyA": "q", "KeyS": "s", "KeyD": "d", "KeyE": "e", "Digit1": "&", "Quote": "ù"}


def test_labels_are_the_letters_of_the_keyboard_where_the_browser_tells(
    chromium: Browser, server: FakeGameServer
) -> None:
    with opened(chromium, server, viewport=DESKTOP) as page:
        told = f"{{ getLayoutMap: async () => new Map(Object.entries({AZERTY})) }}"
        page.add_init_script(f"Object.defineProperty(navigator, 'keyboard', {{ value: {told} }})")
        page.reload()
        start(page, server)
        page.click("#change-keys")
        expect(page.locator("[data-rebind='0']")).to_have_text("↑ / Z")
        expect(page.locator("[data-rebind='3']")).to_have_text("← / Q")
        screenshot(page, "keys-dialog-azerty")


def test_the_third_sign_of_a_key_is_not_taken_for_its_label(chromium: Browser, server: FakeGameServer) -> None:
    with opened(chromium, server, viewport=DESKTOP) as page:
        page.click("#change-keys")
        page.click("[data-rebind='5']")
        press_raw(page, "keydown", code="KeyQ", key="@", modifierAltGraph=True)  # AltGr + Q in Germany, on Linux
        expect(page.locator("[data-rebind='5']")).to_have_text("Q")


@pytest.mark.slow
def test_labels_are_learned_from_the_keys_where_the_browser_does_not_tell(
    chromium: Browser, server: FakeGameServer
) -> None:
    with opened(chromium, server, viewport=DESKTOP) as page:
        page.add_init_script("Object.defineProperty(navigator, 'keyboard', { value: undefined })")
        page.reload()
        start(page, server)
        page.click("#change-keys")
        expect(page.locator("[data-rebind='0']")).to_have_text("↑ / W")
        page.click("[data-rebind='0']")
        press_raw(page, "keydown", code="KeyQ", key="a")
        expect(page.locator("[data-rebind='0']")).to_have_text("A")
        close_keys_dialog(page)
        expect(page.locator(".panel.kb kbd[data-action='0']")).to_have_text("A")
        page.reload()
        page.wait_for_selector("[data-phase=ready]")
        expect(page.locator(".panel.kb kbd[data-action='0']")).to_have_text("A")


@pytest.mark.slow
def test_a_browser_that_keeps_nothing_still_plays(chromium: Browser, server: FakeGameServer) -> None:
    with opened(chromium, server, viewport=DESKTOP) as page:
        page.add_init_script(
            "for (const name of ['localStorage', 'sessionStorage'])"
            " Object.defineProperty(window, name, { get() { throw new DOMException('no', 'SecurityError'); } })"
        )
        page.reload()
        start(page, server)
        page.keyboard.press("ArrowUp")
        were_sent(page, server, taps, [0])


def test_a_key_that_moves_to_another_action_is_not_moved_silently(chromium: Browser, server: FakeGameServer) -> None:
    with opened(chromium, server, viewport=DESKTOP) as page:
        page.wait_for_selector("#start:visible")
        page.click("#change-keys")
        page.click("[data-rebind='0']")
        page.keyboard.press("s")
        assert page.inner_text("[data-rebind='0']") == "S"
        assert page.inner_text("[data-rebind='1']") == "↓"
        assert page.inner_text("#keys-note") == "S was used for “Down”, which now uses ↓."
