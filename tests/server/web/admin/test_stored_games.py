"""What a researcher does about games that no server process plays now: they are in the database alone."""

from server.play.recorder import EpisodeResult
from server.store import decisions, episodes
from tests.support.page_site import PageSite
from tests.support.researcher_site import played, signed_in


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
    assert site.database.read_now(decisions.paused_games, episode) == set()


def test_resuming_a_game_says_that_its_study_is_still_paused(site: PageSite) -> None:
    episode = played(site)
    researcher = signed_in(site, "act")
    page = f"/admin/s/small/game/{episode}"
    site.database.write_now(decisions.pause_study, "small", "mara")
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
