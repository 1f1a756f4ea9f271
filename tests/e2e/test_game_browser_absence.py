"""A participant who leaves the page: the game hears of it in every phase, and does not begin with nobody there."""

import pytest
from msgspec import structs
from playwright.sync_api import Browser, Page, expect

from server.play.messages import Away, Countdown, Ended, EndReason, Outgoing, Paused, PauseReason, Ready
from tests.support.browser.fake_game_server import FakeGameServer, kitchen, tick, welcome
from tests.support.browser.game_page import opened, settled, start
from tests.support.parameters import mostly_slow

pytestmark = [pytest.mark.browser, pytest.mark.timeout(90)]


def leave(page: Page) -> None:
    page.evaluate("document.hasFocus = () => false; window.dispatchEvent(new Event('blur'))")


def come_back(page: Page) -> None:
    page.evaluate("delete document.hasFocus; window.dispatchEvent(new Event('focus'))")


@pytest.mark.parametrize("reason", mostly_slow(["partner", "researcher", "database"]))
def test_a_participant_who_leaves_during_a_pause_is_away_and_can_come_back(
    chromium: Browser, server: FakeGameServer, reason: PauseReason
) -> None:
    with opened(chromium, server) as page:
        start(page, server)
        server.send(Paused(reason, 0.0))
        page.wait_for_selector(f"[data-view={'banner' if reason == 'database' else 'pause'}]")
        leave(page)
        server.wait_for(lambda server: server.of(Away) == [Away("blur")])
        server.send(Paused("blur", 30.0))
        page.wait_for_selector("#pause-button:visible")
        come_back(page)
        server.wait_for(lambda server: len(server.of(Ready)) == 2)
        server.send(Paused(reason, 0.0), Countdown(0), tick(kitchen(t=2)))
        expect(page.locator("[data-timestep='2'][data-view=none]")).to_be_visible()


def test_a_participant_who_leaves_right_after_start_is_away(chromium: Browser, server: FakeGameServer) -> None:
    with opened(chromium, server) as page:
        page.wait_for_selector("[data-phase=ready]")
        page.click("#start-button")
        leave(page)
        server.wait_for(lambda server: server.of(Away) == [Away("blur")])
        server.send(Countdown(1))
        page.wait_for_selector("[data-phase=countdown]")
        settled(page, server)
        assert server.of(Away) == [Away("blur")], "said once"
        come_back(page)
        server.wait_for(lambda server: len(server.of(Ready)) == 2)


def test_a_countdown_that_finds_nobody_is_stopped(chromium: Browser, server: FakeGameServer) -> None:
    with opened(chromium, server) as page:
        start(page, server)
        server.send(Paused("database", 0.0))
        page.wait_for_selector("[data-view=banner]")
        page.evaluate("document.hasFocus = () => false")  # no event told of it
        server.send(Countdown(3))
        server.wait_for(lambda server: server.of(Away) == [Away("blur")])
        server.send(Paused("blur", 30.0))
        come_back(page)
        server.wait_for(lambda server: len(server.of(Ready)) == 2)
        assert server.of(Away) == [Away("blur")], "said once"


def test_a_browser_that_never_says_that_the_page_has_the_focus_plays(chromium: Browser, server: FakeGameServer) -> None:
    with opened(chromium, server) as page:
        page.wait_for_selector("[data-phase=ready]")
        page.evaluate("document.hasFocus = () => false")
        start(page, server)
        settled(page, server)
        assert server.of(Away) == []
        leave(page)  # an event tells of it, as before
        server.wait_for(lambda server: server.of(Away) == [Away("blur")])


@pytest.mark.parametrize(
    ("reason", "seconds"), mostly_slow([("blur", "30"), ("partner", "30"), ("researcher", ""), ("database", "")])
)
def test_a_lost_connection_names_a_limit_only_if_the_absence_counts(
    chromium: Browser, server: FakeGameServer, reason: PauseReason, seconds: str
) -> None:
    with opened(chromium, server) as page:
        start(page, server)
        server.send(Paused(reason, 0.0))
        page.wait_for_selector("[data-phase=paused]")
        server.refusing = True
        server.drop()
        page.wait_for_selector("[data-link=lost] #banner:visible")
        words = page.inner_text("#banner-left")
        assert seconds in words if seconds else not words


@pytest.mark.parametrize(
    ("sent", "seconds"),
    mostly_slow(
        [
            ([Countdown(0, 8.0)], "8 seconds"),
            ([Countdown(0, 25.0), Paused("partner", 5.0)], "5 seconds"),
            ([Countdown(0, 3.0), Paused("server", 0.0)], "3 seconds"),
            ([structs.replace(welcome(resumed=True), away_s=7.0)], "7 seconds"),
        ]
    ),
)
def test_a_lost_connection_names_what_earlier_absences_have_left(
    chromium: Browser, server: FakeGameServer, sent: list[Outgoing], seconds: str
) -> None:
    with opened(chromium, server) as page:
        start(page, server)
        server.send(*sent)
        settled(page, server)
        server.refusing = True
        server.drop()
        expect(page.locator("#banner-left")).to_contain_text(seconds)


def test_leaving_before_start_is_not_an_absence(chromium: Browser, server: FakeGameServer) -> None:
    with opened(chromium, server) as page:
        page.wait_for_selector("[data-phase=ready]")
        leave(page)
        come_back(page)
        settled(page, server)
        assert not server.of(Away)
        assert not server.of(Ready)


def test_a_participant_whom_the_partner_waits_for_sees_it_on_the_tab_and_how_long(
    chromium: Browser, server: FakeGameServer
) -> None:
    server.welcome = structs.replace(server.welcome, partner="human")  # type: ignore[arg-type]
    with opened(chromium, server) as page:
        page.wait_for_selector("#start:visible")
        plain = page.title()
        page.evaluate("Object.defineProperty(document, 'hidden', { configurable: true, value: true })")
        server.send(Paused("lost", 20.0))
        expect(page).to_have_title("Your partner is waiting for you!")
        assert page.inner_text("#start-title").startswith("Round"), "the game has not begun"
        assert page.inner_text("#start-left") == "Please start within 20 seconds."
        page.evaluate("delete document.hidden")
        expect(page).to_have_title(plain)


def test_no_start_dialog_appears_if_both_players_were_ready_at_the_same_time(
    chromium: Browser, server: FakeGameServer
) -> None:
    server.page |= {"ready_page": True}
    server.welcome = structs.replace(server.welcome, partner="human")  # type: ignore[arg-type]
    with opened(chromium, server) as page:
        server.wait_for(lambda server: bool(server.of(Ready)))
        server.send(Paused("lost", 20.0))
        page.wait_for_selector("[data-phase=paused]")
        assert page.get_attribute(".game", "data-view") == "none"
        server.send(Countdown(0), tick(kitchen(t=1)))
        page.wait_for_selector("[data-phase=playing]")


@pytest.mark.parametrize(("t", "words"), [(0, "The game starts in 3 seconds."), (5, "Resuming in 3 seconds.")])
def test_a_screen_reader_hears_if_a_game_begins_or_continues(
    chromium: Browser, server: FakeGameServer, t: int, words: str
) -> None:
    server.welcome = structs.replace(server.welcome, state=kitchen(t=t))  # type: ignore[arg-type]
    with opened(chromium, server) as page:
        page.click("#start-button")
        server.wait_for(lambda server: bool(server.of(Ready)))
        server.send(Countdown(3))
        expect(page.locator("#urgent")).to_have_text(words)


def test_a_participant_who_expects_a_partner_is_told_of_the_agent_before_the_round(
    chromium: Browser, server: FakeGameServer
) -> None:
    server.page |= {"ready_page": True, "expects_partner": True}
    with opened(chromium, server) as page:
        page.wait_for_selector("#start:visible")
        assert page.inner_text("#start-title") == "An AI chef steps in"
        assert server.of(Ready) == []
        page.click("#start-button")
        server.wait_for(lambda server: bool(server.of(Ready)))


def test_a_page_names_the_kitchen_in_its_own_language(chromium: Browser, server: FakeGameServer) -> None:
    server.page |= {"language": "zh", "title": "协作环"}
    with opened(chromium, server) as page:
        expect(page.locator("#title")).to_have_text("协作环")
        assert page.inner_text("#start-title").endswith("协作环")


def test_no_time_is_shown_when_it_is_over(chromium: Browser, server: FakeGameServer) -> None:
    server.page |= {"away_s": 1}
    with opened(chromium, server) as page:
        start(page, server)
        server.refusing = True
        server.cut()
        page.wait_for_selector("#banner:visible")
        expect(page.locator("#banner-left")).to_have_text(
            "Please wait; the round ends if this takes longer than 1 second."
        )
        expect(page.locator("#banner-left")).to_have_text("")
        expect(page.locator("#banner-text")).to_contain_text("the round may have ended")


@pytest.mark.parametrize(
    ("kind", "partner", "reason", "words"),
    mostly_slow(
        [
            ("episode", "human", "away", "One player was away too long, so you two will no longer play together."),
            ("episode", "human", "withdrawn", "Your partner has left the study, so this round ends here."),
            ("episode", "human", "researcher", "It was stopped early."),
            ("episode", "agent", "away", "You were away too long, so the round was stopped."),
            ("episode", "agent", "error", "It was stopped early."),
            ("tutorial", "agent", "away", "You were away too long, so the practice starts again."),
        ]
    ),
)
def test_a_participant_reads_why_a_game_ended_before_its_time(
    chromium: Browser, server: FakeGameServer, kind: str, partner: str, reason: EndReason, words: str
) -> None:
    server.welcome = structs.replace(server.welcome, kind=kind, partner=partner)  # type: ignore[arg-type]
    with opened(chromium, server) as page:
        start(page, server)
        server.send(Ended(0, 0, 0.0, False, "/blank", reason))
        page.wait_for_selector("#over:visible")
        assert page.inner_text("#over-text").startswith(words)
        assert not page.inner_text("#over-next").startswith("over.")
