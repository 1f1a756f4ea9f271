"""What becomes of the other person when one of two withdraws: the shared rounds are deleted, and count as played."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from sqlalchemy import Connection, select

import kitchenmind
from server.participation import pairing, progress
from server.participation.game_seats import ConnectedPlayer, Seating
from server.participation.served_studies import Studies
from server.play.recorder import EpisodeResult
from server.store import episodes, events, participants
from server.store.database import Database
from server.store.participants import Participant
from server.store.table_base import metadata
from server.store.withdrawal import withdraw
from server.study.loader import parse_study
from tests.support.study_text import study_head

STUDY = (
    study_head("pairs", "Two people", seed=5)
    + """
conditions: [{name: tom, predictor: tom}]
agents: [{name: person, human: true, predictor: random}]
layouts: [{name: coordination_ring, title: {en: Ring}}]
order: {repeat: 3}
waiting_room: {limit_s: 20, fallback: agent}
flow: [episodes, thanks]
"""
)


class Pair:
    """Two people in one study: who stays, and who withdraws."""

    def __init__(self, database: Database, studies: Studies, tokens: list[str]) -> None:
        self.database, self.studies, self.tokens = database, studies, tokens
        self.seating = Seating(database, studies, lambda layout, model: None, "test")
        found = [database.read_now(participants.by_token, token) for token in tokens]
        self.stays, self.leaves = (one.id for one in found if one is not None)

    def now(self, who: str) -> Participant:
        found = self.database.read_now(participants.get, who)
        assert found is not None
        return found

    def step(self) -> str:
        """The step of the one who stays."""
        return self.studies.step(self.now(self.stays)).key

    def open_page(self) -> None:
        """The one who stays opens the page of the current step."""
        self.database.write_now(progress.arrive, self.studies, self.stays)

    def walk_to(self, who: str, key: str) -> None:
        while self.studies.step(self.now(who)).key != key:
            step = self.studies.step(self.now(who))
            assert self.database.write_now(progress.submit, self.studies, who, progress.Submission(step))

    async def play(self, number: int, end: str | None = "horizon") -> str:
        """Bring both to a round and seat them; `end`: how it ends, None for a round that is still played."""
        for who in (self.stays, self.leaves):
            self.walk_to(who, f"episode-{number:02d}")
        assert await self.seating.seat_two(self.stays, self.leaves)
        made = self.database.read_now(episodes.of_step, self.stays, f"episode-{number:02d}")
        assert made is not None
        if end is not None:
            status = "done" if end == "horizon" else "aborted"
            result = EpisodeResult(made.id, status, end, 60, 3, 9.0, True, "0" * 16)  # type: ignore[arg-type]
            await self.database.write(episodes.end, result)
        return made.id

    async def come_to(self, number: int) -> ConnectedPlayer:
        """The one who stays opens the page of a round; their game."""
        self.walk_to(self.stays, f"episode-{number:02d}")
        found = await self.seating.find(self.tokens[0], "pairs")
        assert found is not None
        return found

    def noted(self, kind: str) -> list[dict[str, Any]]:
        return [dict(one.detail) for one in self.database.read_now(events.of_participant, self.stays, kind)]


MakePair = Callable[..., Any]


@pytest.fixture
def make(database: Database) -> MakePair:
    async def pair(text: str = STUDY) -> Pair:
        studies = await Studies.opened(database, [parse_study(text)])
        tokens = ["token-of-who-stays", "token-of-who-leaves"]
        for token in tokens:
            await database.write(progress.enrol, studies, progress.ConsentArrival("pairs", token))
        return Pair(database, studies, tokens)

    return pair


@pytest.mark.parametrize("end", [None, "horizon", "withdrawn"])
async def test_a_round_that_a_withdrawal_deleted_is_not_played_again(make: MakePair, end: str | None) -> None:
    pair = await make()
    await pair.play(1, end)
    assert pair.database.write_now(withdraw, pair.leaves)
    game = await pair.seating.find(pair.tokens[0], "pairs")
    assert (game.episode, game.request) == (None, None), "a page that connects again is not seated again"
    pair.open_page()
    assert pair.step() == "ready-02"


async def test_all_later_rounds_are_played_alone_because_the_partner_left(make: MakePair) -> None:
    pair = await make()
    await pair.play(1)
    pair.database.write_now(withdraw, pair.leaves)
    for number in (2, 3):
        game = await pair.come_to(number)
        assert game.episode is not None
        await pair.database.write(
            episodes.end, EpisodeResult(game.episode, "done", "horizon", 60, 3, 9.0, True, "0" * 16)
        )
    assert pair.noted("alone") == [{"step": f"episode-0{number}", "why": "partner_left"} for number in (2, 3)]
    assert pair.noted(events.PARTNER_WITHDREW) == [{"step": "episode-01"}]


async def test_an_agent_in_the_partners_place_is_news_in_the_first_round_with_it(make: MakePair) -> None:
    pair = await make()
    await pair.play(1)
    pair.database.write_now(withdraw, pair.leaves)
    for number in (2, 3):
        game = await pair.come_to(number)
        here = pair.now(pair.stays)
        expects = pair.database.read_now(pairing.expects_partner, pair.studies, here, pair.studies.step(here))
        assert expects == (number == 2)
        await pair.database.write(
            episodes.end, EpisodeResult(game.episode, "done", "horizon", 60, 3, 9.0, True, "0" * 16)
        )


async def test_who_is_past_the_shared_rounds_also_continues_alone(make: MakePair) -> None:
    pair = await make()
    await pair.play(1)
    await pair.play(2)
    pair.walk_to(pair.stays, "episode-03")
    pair.database.write_now(withdraw, pair.leaves)
    step = pair.studies.step(pair.now(pair.stays))
    found = pair.database.read_now(pairing.company, pair.studies, pair.now(pair.stays), step)
    assert found == pairing.Company(alone="partner_left")


async def test_who_waits_for_a_partner_who_withdraws_does_not_count_as_never_paired(make: MakePair) -> None:
    pair = await make()
    await pair.play(1)
    pair.walk_to(pair.stays, "episode-02")
    pair.database.write_now(withdraw, pair.leaves)
    await pair.seating.seat_alone(pair.stays)  # the wait is over
    assert [one["why"] for one in pair.noted("alone")] == ["partner_left"]


@pytest.mark.parametrize("how", ["withdrawn", "screened_out", "timed_out"])
async def test_who_waits_is_found_to_have_lost_a_partner_who_leaves_the_study(make: MakePair, how: str) -> None:
    pair = await make()
    await pair.play(1)
    pair.walk_to(pair.stays, "episode-02")
    pair.open_page()
    game = await pair.seating.find(pair.tokens[0], "pairs")
    assert game.request.partner == pair.leaves
    assert await pair.seating.outlook(pair.stays) == "open"
    if how == "withdrawn":
        pair.database.write_now(withdraw, pair.leaves)
    else:
        pair.database.write_now(participants.leave, pair.leaves, how)
    assert await pair.seating.outlook(pair.stays) == "gone"
    assert await pair.seating.outlook(pair.leaves) == "gone", "who has left waits for nobody"


async def test_a_game_that_ended_by_a_withdrawal_leaves_nobody_to_wait_for(make: MakePair) -> None:
    """Between the end of the game and the deletion, the partner is still there."""
    pair = await make()
    await pair.play(1, "withdrawn")
    pair.walk_to(pair.stays, "episode-02")
    step = pair.studies.step(pair.now(pair.stays))
    found = pair.database.read_now(pairing.company, pair.studies, pair.now(pair.stays), step)
    assert found == pairing.Company(alone="partner_left")


@pytest.mark.parametrize("end", ["away", "withdrawn"])
async def test_no_round_is_announced_that_a_study_without_a_fallback_agent_does_not_have(
    make: MakePair, end: str
) -> None:
    pair = await make(STUDY.replace("fallback: agent", "fallback: leave"))
    await pair.play(1, end)
    if end == "withdrawn":
        pair.database.write_now(withdraw, pair.leaves)
    pair.open_page()
    stays = pair.now(pair.stays)
    assert (stays.status, pair.step()) == ("returned", "ready-02")
    assert stays.completion_code, "and is paid"
    assert pair.noted("alone") == [{"step": "episode-02", "why": "partner_left"}]
    pair.open_page()
    assert pair.now(pair.stays) == stays


async def test_who_still_has_a_partner_gets_the_page_before_the_next_round(make: MakePair) -> None:
    pair = await make(STUDY.replace("fallback: agent", "fallback: leave"))
    await pair.play(1)
    pair.open_page()
    assert (pair.now(pair.stays).status, pair.step()) == ("active", "ready-02")


async def test_after_the_only_round_the_study_continues_to_its_end(make: MakePair) -> None:
    pair = await make(STUDY.replace("fallback: agent", "fallback: leave").replace("repeat: 3", "repeat: 1"))
    await pair.play(1, None)
    pair.database.write_now(withdraw, pair.leaves)
    pair.open_page()
    stays = pair.now(pair.stays)
    assert (pair.step(), stays.status) == ("thanks", "completed")


async def test_nothing_of_who_withdrew_remains_with_the_other_person(make: MakePair) -> None:
    pair = await make()
    shared = await pair.play(1)
    pair.database.write_now(withdraw, pair.leaves)

    def everything(connection: Connection) -> str:
        return repr([connection.execute(select(table)).all() for table in metadata.sorted_tables])

    stored = pair.database.read_now(everything)
    assert pair.leaves not in stored
    assert shared not in stored


async def test_the_deleted_rounds_are_exported_and_imported(make: MakePair, url: str, tmp_path: Path) -> None:
    pair = await make()
    await pair.play(1)
    pair.database.write_now(withdraw, pair.leaves)
    again = f"sqlite:///{tmp_path}/again.db"
    assert kitchenmind.main(["export", "--database", url, "--out", str(tmp_path / "export")]) == 0
    assert kitchenmind.main(["import", str(tmp_path / "export"), "--database", again]) == 0
    assert kitchenmind.main(["verify", "--database", again]) == 0
    with Database(again, read_only=True) as copy:
        (noted,) = copy.read_now(events.of_participant, pair.stays, events.PARTNER_WITHDREW)
    assert (noted.episode_id, noted.detail) == (None, {"step": "episode-01"})
