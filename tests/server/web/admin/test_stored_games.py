"""What a researcher does about games that no server process plays now: they are in the database alone."""

import asyncio
import json
from functools import partial
from pathlib import Path

import pytest
from sqlalchemy import update
from websockets.sync.client import ClientConnection, connect

from server.monitoring.alerts import Alerts
from server.play.games import Games
from server.play.recorder import EpisodeResult
from server.store import audit, episodes, interventions
from server.store.store_recorder import StoreRecorder
from server.store.tables import ticks
from server.web.admin import replay_page
from tests.support.live_fakes import QuietConnection
from tests.support.page_site import PageSite
from tests.support.researcher_site import played, signed_in


@pytest.fixture
def games(site: PageSite) -> Games:
    """The games of the site, which are read from its database."""
    found = site.services.live.games
    found._load = partial(site.database.read, episodes.load)
    return found


def damage(site: PageSite, episode: str) -> None:
    """Store another state than the one to which the stored actions lead."""
    other = update(ticks).where(ticks.c.episode_id == episode).values(state_hash=bytes(8), reward_0=20)
    site.database.write_now(lambda connection: connection.execute(other))


def test_a_game_that_nobody_plays_now_is_paused_and_resumed_in_the_database(site: PageSite) -> None:
    episode = played(site)
    researcher = signed_in(site, "act")
    page = f"/admin/s/small/game/{episode}"
    researcher.get(page)
    assert "The game is paused." in researcher.post(f"{page}/pause", note="a call", next=page).text
    assert "Paused by act" in researcher.page.text
    stored = site.database.read_now(episodes.load, episode)
    assert stored is not None
    assert stored.is_paused
    assert "The game continues." in researcher.post(f"{page}/resume", next=page).text
    assert "Paused by act" not in researcher.page.text
    assert site.database.read_now(interventions.paused_games, episode) == set()


def test_an_open_page_of_a_game_follows_who_pauses_it(site: PageSite, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(replay_page, "PAUSED_EVERY_S", 0.0)
    episode = played(site)
    cookie = f"researcher={signed_in(site, 'watch').client.cookies['researcher']}"
    address = site.url.replace("http", "ws") + f"/admin/s/small/game/{episode}/live"

    def heard(socket: ClientConnection, by: str | None) -> bool:
        return any(json.loads(socket.recv(20)) == {"type": "paused", "by": by} for _ in range(20))

    with connect(address, additional_headers={"cookie": cookie}) as socket:
        for by in ("mara", None):
            site.database.write_now(interventions.pause_game, episode, by)
            assert heard(socket, by)


def test_more_time_counts_when_the_game_is_taken_up_again(site: PageSite, games: Games) -> None:
    episode = played(site)
    researcher = signed_in(site, "act")
    page = f"/admin/s/small/game/{episode}"
    researcher.get(page)
    for minutes in ("2", "3"):
        assert "more time now" in researcher.post(f"{page}/extend", minutes=minutes, note="a call", next=page).text
    game = asyncio.run(games.open(episode))
    assert game.session.pause_reasons.next_absence_s(games.clock.now()) == 330.0, "30 s of the study and 5 minutes"
    site.database.write_now(episodes.end, EpisodeResult(episode, "done", "horizon", 0, 0, 0.0, True, "0" * 16))
    assert "already ended" in researcher.post(f"{page}/extend", minutes="5", note="again", next=page).text
    noted = [entry.detail for entry in site.database.read_now(audit.entries) if entry.action == "extend game"]
    assert [(one["minutes"], one["done"]) for one in noted if one] == [(2, True), (3, True), (5, False)]


def test_resuming_a_game_says_that_its_study_is_still_paused(site: PageSite) -> None:
    episode = played(site)
    researcher = signed_in(site, "act")
    page = f"/admin/s/small/game/{episode}"
    site.database.write_now(interventions.pause_study, "small", "mara")
    researcher.get(page)
    assert "continues when you resume the study" in researcher.post(f"{page}/resume", next=page).text


def test_a_game_that_is_over_is_not_paused(site: PageSite) -> None:
    episode = played(site)
    researcher = signed_in(site, "act")
    page = f"/admin/s/small/game/{episode}"
    researcher.get(page)
    result = EpisodeResult(episode, "done", "horizon", 0, 0, 0.0, True, "0" * 16)
    site.database.write_now(episodes.end, result)
    assert "already ended" in researcher.post(f"{page}/pause", note="a call", next=page).text
    assert "Pause game" not in researcher.page.text


def test_a_game_that_nobody_plays_now_is_ended_with_what_was_played(site: PageSite, games: Games) -> None:
    episode = played(site)
    researcher = signed_in(site, "act")
    page = f"/admin/s/small/game/{episode}"
    researcher.get(page)
    assert "The game is ended." in researcher.post(f"{page}/end", note="they went home", next=page).text
    stored = site.database.read_now(episodes.get, episode)
    assert stored is not None
    assert (stored.status, stored.end_reason, stored.score, stored.progress) == ("aborted", "researcher", 0, 0.0)
    assert "already ended" in researcher.post(f"{page}/end", note="again", next=page).text


def test_a_released_participant_leaves_no_unfinished_game(
    site: PageSite, games: Games, monkeypatch: pytest.MonkeyPatch
) -> None:
    store = StoreRecorder.end

    async def store_slowly(recorder: StoreRecorder, result: EpisodeResult) -> None:
        await asyncio.sleep(0.3)
        await store(recorder, result)

    monkeypatch.setattr(StoreRecorder, "end", store_slowly)
    episode = played(site)
    researcher = signed_in(site, "act")
    person = site.only("small").id
    researcher.get(f"/admin/s/small/person/{person}")
    researcher.post(f"/admin/s/small/person/{person}/release", note="they went home")
    stored = site.database.read_now(episodes.get, episode)
    assert stored is not None
    assert stored.status == "aborted"


def test_a_game_that_cannot_be_played_again_is_an_alert_until_a_researcher_ends_it(
    site: PageSite, games: Games, tmp_path: Path
) -> None:
    episode = played(site)
    damage(site, episode)
    alerts = Alerts(site.services.live, tmp_path / "site.db", lambda *_: None)
    for _ in range(2):
        with pytest.raises(Exception, match="do not lead to the stored state"):
            asyncio.run(games.join(episode, 0, QuietConnection()))
    asyncio.run(alerts.check())
    (shown,) = alerts.shown("small")
    assert "P-001 cannot continue the game E1" in str(shown["text"])
    page = str(shown["path"])
    researcher = signed_in(site, "act")
    researcher.get(page)
    assert "The game is ended." in researcher.post(f"{page}/end", note="a damaged disk", next=page).text
    stored = site.database.read_now(episodes.get, episode)
    assert stored is not None
    assert (stored.status, stored.end_reason, stored.passed) == ("aborted", "researcher", False)
    assert (stored.score, stored.soups, stored.progress) == (260, 0, None)
    assert [entry.action for entry in site.database.read_now(audit.entries)][-1] == "end game"
    asyncio.run(alerts.check())
    assert alerts.shown("small") == []
    assert "P-001" in researcher.get(page).text


def test_a_refused_action_says_what_to_choose_instead(site: PageSite) -> None:
    researcher = signed_in(site, "act")
    game = f"/admin/s/small/game/{played(site)}"
    researcher.get(game)
    token = researcher.token()
    unknown = researcher.post(f"{game}/dance", token)
    assert (unknown.status_code, "Reload the page and choose it again." in unknown.text) == (404, True)
    without = researcher.post(f"{game}/exclude", token)
    assert (without.status_code, "Choose one from the list." in without.text) == (400, True)
    long = researcher.post(f"{game}/extend", token, minutes="90")
    assert (long.status_code, "90 minutes are not possible. Give 1 to 60." in long.text) == (400, True)
