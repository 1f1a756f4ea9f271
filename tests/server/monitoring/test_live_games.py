"""Boards for researchers: encoded once a timestep, however many pages show them."""

from types import SimpleNamespace
from typing import Any, cast
from unittest.mock import AsyncMock

import msgspec

from models.protocols import Decision
from server.monitoring.live_games import LiveGames, board_of
from server.monitoring.peers import View
from server.play.game import Game
from server.play.intentions import NO_INTENTION_SHOWN
from server.play.session import Session
from server.web.admin.live_boards import Watching
from tests.support.live_fakes import RuleModels, make_spec, new_record


def played_game(**changes: object) -> tuple[Game, Session]:
    session = Session(new_record(make_spec(**changes)), 0.0)
    session.finish_tick([RuleModels().decide(question) for question in session.begin_start()], 1.0)
    return cast(Game, SimpleNamespace(session=session, episode=session.episode)), session


def watched() -> LiveGames:
    nothing: Any = None
    return LiveGames(nothing, nothing, nothing)


def test_pages_that_show_the_same_timestep_share_one_encoding() -> None:
    game, _ = played_game()
    live = watched()
    assert live.encoded_board(game, blind=False) is live.encoded_board(game, blind=False)
    assert msgspec.json.decode(live.encoded_board(game, blind=False)) == msgspec.json.decode(
        msgspec.json.encode(board_of(game, blind=False))
    )


def test_a_blind_page_never_gets_the_encoding_with_predictions() -> None:
    game, _ = played_game()
    live = watched()
    assert msgspec.json.decode(live.encoded_board(game, blind=False))["prediction"]
    assert msgspec.json.decode(live.encoded_board(game, blind=True))["prediction"] == []


async def test_a_blind_page_never_gets_the_marks_of_a_game_that_another_process_plays() -> None:
    board = board_of(played_game(display="both")[0], blind=False)
    view = View("e1", 1, "tom", "running", {}, msgspec.json.decode(msgspec.json.encode(board)), {})
    studies = SimpleNamespace(versions=lambda _: (1,), open=lambda _: (1, None))
    live = SimpleNamespace(cards=AsyncMock(return_value=[]), views=AsyncMock(return_value=[view]))
    admin = SimpleNamespace(blind=True)
    watching = Watching(cast(Any, SimpleNamespace(studies=studies)), cast(Any, live), "short", cast(Any, admin))
    watching.asked('{"show": ["e1"]}')
    shown = (await watching.news())["boards"]["e1"]
    assert shown["prediction"] == []
    assert shown["intention"][0] == NO_INTENTION_SHOWN != board["intention"][0]


def test_the_next_timestep_is_encoded_afresh_with_its_own_predictions() -> None:
    game, session = played_game()
    live = watched()
    live.encoded_board(game, blind=False)
    session.start_at(0.0)
    questions = session.begin_tick(0.2)
    between = live.encoded_board(game, blind=False)  # the rules have run, the models have not answered yet
    silent: list[Decision | None] = [None] * len(questions)
    session.finish_tick(silent, 1.0)
    after = msgspec.json.decode(live.encoded_board(game, blind=False))
    assert msgspec.json.decode(between)["state"]["t"] == after["state"]["t"] == 1
    assert after["prediction"] == [list(mark) for mark in session.frames.displayed]
