"""Rounds of two people over real sockets: pairing, what each person sees, and what happens when one leaves."""

import asyncio
import re
from collections.abc import Awaitable, Callable, Iterator, Sequence
from contextlib import asynccontextmanager, suppress
from dataclasses import dataclass
from typing import Any

import msgspec
import pytest
from sqlalchemy import Connection, select
from websockets.asyncio.client import ClientConnection, connect
from websockets.exceptions import ConnectionClosed
from websockets.typing import Origin

from server.bots.local_server import OwnServer
from server.bots.participant import Bot, Habits
from server.play import messages
from server.play.close_codes import CloseCode
from server.store.database import Database
from server.store.participants import token_hash
from server.store.tables import episodes, events, participants, ticks
from server.verification import verify_all
from tests.support.study_text import study_head

STUDY = (
    study_head("pairs", "Two people", seed=5)
    + """
conditions: [{name: tom, predictor: tom}]
agents: [{name: person, human: true, predictor: random}]
layouts: [{name: coordination_ring, title: {en: Ring}}, {name: matrix, title: {en: Matrix}}]
game: {horizon: 60, deadline_ms: 190, pause: {each_s: 12, episode_s: 24}}
waiting_room: {limit_s: 20, fallback: agent}
flow: [episodes, thanks]
"""
)
PAID = STUDY.replace("name: pairs", "name: paid", 1).replace("fallback: agent", "fallback: leave")
decoder = msgspec.json.Decoder(messages.Outgoing)


Pair = tuple[Bot, ...]


class PairedPerson:
    """Somebody at the page of a game, message by message."""

    def __init__(self, bot: Bot, socket: ClientConnection, tab: str) -> None:
        self.bot, self.socket, self.tab = bot, socket, tab
        self.welcome: messages.Welcome | None = None
        self.ticks: list[messages.Tick] = []

    async def say(self, message: messages.Incoming) -> None:
        await self.socket.send(msgspec.json.encode(message).decode())

    async def hear(self, *kinds: type) -> Any:
        """The next message of one of these kinds; earlier messages are kept."""
        async with asyncio.timeout(20):
            while True:
                message = decoder.decode(await self.socket.recv())
                if isinstance(message, messages.Ping):
                    await self.say(messages.Pong(message.id))
                if isinstance(message, messages.Welcome):
                    self.welcome = message
                if isinstance(message, messages.Tick):
                    self.ticks.append(message)
                if isinstance(message, kinds):
                    return message

    async def hear_close(self) -> int:
        async with asyncio.timeout(20):
            with suppress(ConnectionClosed):
                while True:
                    await self.hear(messages.Ping, messages.Waiting, messages.Tick, messages.Ended)
        return self.socket.close_code or 0


@asynccontextmanager
async def at_the_game(bot: Bot, tab: str = "tab-of-this-person") -> Any:
    game = bot.game()
    origin = Origin("http" + game.url.removeprefix("ws").split("/s/")[0])
    async with connect(game.url, additional_headers={"Cookie": game.cookie}, origin=origin) as socket:
        person = PairedPerson(bot, socket, tab)
        await person.say(messages.Hello(messages.PROTOCOL, tab))
        yield person


async def somebody(server: OwnServer, seed: int, study: str = "pairs") -> Bot:
    """A participant at the page of the first round."""
    bot = Bot(server.url, study, seed, Habits(reloads=False))
    page = await bot.consent()
    while not page.is_game:
        page = await bot.submit(page)
    return bot


async def together(server: OwnServer, do: Callable[[PairedPerson, PairedPerson], Awaitable[None]]) -> Pair:
    """Two people who have been brought together, connected, before anybody has pressed start."""
    first, second = await somebody(server, 1), await somebody(server, 2)
    async with at_the_game(first) as one:
        await one.hear(messages.Waiting)
        async with at_the_game(second) as two:
            assert [await one.hear_close(), await two.hear_close()] == [CloseCode.GAME_READY, CloseCode.GAME_READY]
    async with at_the_game(first) as one, at_the_game(second) as two:
        await one.hear(messages.Welcome)
        await two.hear(messages.Welcome)
        await do(one, two)
    await first.close()
    await second.close()
    return first, second


@pytest.fixture(scope="module")
def server(tmp_path_factory: pytest.TempPathFactory) -> Iterator[OwnServer]:
    """Serves both studies."""
    folder = tmp_path_factory.mktemp("pairs")
    study, paid = folder / "pairs.yaml", folder / "paid.yaml"
    study.write_text(STUDY, encoding="utf-8")
    paid.write_text(PAID, encoding="utf-8")
    running = OwnServer(f"sqlite:///{folder / 'pairs.sqlite3'}", study, {"KITCHENMIND_SPEED": "8"})
    running.add_study(paid)
    with running:
        yield running


@dataclass
class Kept:
    """What is stored of some people."""

    people: list[Any]
    episodes: list[Any]
    events: list[Any]
    ticks: list[Any]


def stored(server: OwnServer, bots: Sequence[Bot]) -> Kept:
    def read(connection: Connection) -> Kept:
        assert all(result.difference is None for result in verify_all(connection))
        hashes = [token_hash(bot.token) for bot in bots]
        people = connection.execute(select(participants).where(participants.c.token_hash.in_(hashes))).all()
        ids = [one.id for one in people]
        theirs = episodes.c.participant_0.in_(ids) | episodes.c.participant_1.in_(ids)
        played = connection.execute(select(episodes).where(theirs).order_by(episodes.c.number)).all()
        noted = connection.execute(select(events).where(events.c.participant_id.in_(ids))).all()
        of_first = select(ticks).where(ticks.c.episode_id == (played[0].id if played else ""))
        made = connection.execute(of_first.order_by(ticks.c.timestep)).all()
        return Kept(list(people), list(played), list(noted), list(made))

    with Database(server.database, read_only=True) as database:
        return database.read_now(read)


async def start(one: PairedPerson, two: PairedPerson) -> None:
    await one.say(messages.Ready())
    await two.say(messages.Ready())
    await one.hear(messages.Countdown)


def test_two_play_one_game_each_as_their_own_chef_and_only_the_watcher_sees_marks(server: OwnServer) -> None:
    async def play(one: PairedPerson, two: PairedPerson) -> None:
        assert one.welcome is not None
        assert two.welcome is not None
        assert one.welcome.episode == two.welcome.episode
        assert [one.welcome.seat, two.welcome.seat] == [0, 1]
        assert one.welcome.partner == two.welcome.partner == "human"
        assert [one.welcome.shows_predictions, two.welcome.shows_predictions] == [True, False]
        await start(one, two)
        await one.say(messages.Input(1, 2, None, 1.0))  # each holds another key
        await two.say(messages.Input(1, 1, None, 1.0))
        await asyncio.gather(one.hear(messages.Ended), two.hear(messages.Ended))
        states = [{tick.state.t: tick.state for tick in person.ticks} for person in (one, two)]
        assert states[0] == states[1]
        late = [tick for tick in one.ticks if tick.state.t > 20]
        assert {tick.actions for tick in late} == {(2, 1)}
        assert any(action != 6 for tick in one.ticks[1:] for action, _ in tick.prediction)
        assert all(action == 6 for tick in two.ticks for action, _ in tick.prediction)

    kept = stored(server, asyncio.run(together(server, play)))
    (episode,) = kept.episodes
    assert {episode.participant_0, episode.participant_1} == {one.id for one in kept.people}
    assert (episode.agent_0, episode.agent_1, episode.status) == (None, None, "done")
    assert episode.agent_name == "person", "the partner has the name that the study gives it"
    assert len(kept.ticks) == 61
    deadline_ms = episode.spec["deadline_ms"]
    missed = [row for row in kept.ticks[:-1] if row.prediction is None]  # on a busy machine, now and then
    assert all(row.models_ms > deadline_ms for row in missed)
    assert len(missed) < 20
    assert any(row.key_seq_0 == 1 and row.key_seq_1 == 1 for row in kept.ticks)
    assert [row.kind for row in kept.events] == ["paired", "paired"]


def test_reload_of_one_pauses_both_and_both_resume_at_the_same_timestep(server: OwnServer) -> None:
    async def play(one: PairedPerson, two: PairedPerson) -> None:
        await start(one, two)
        while (await two.hear(messages.Tick)).state.t < 10:
            pass
        two.socket.transport.abort()
        paused = await one.hear(messages.Paused)
        assert paused.reason == "partner"
        assert paused.left_s > 0
        stood = one.ticks[-1].state.t
        async with at_the_game(two.bot) as again:
            assert (await again.hear(messages.Welcome)).state.t == stood
            await again.say(messages.Ready())
            await asyncio.gather(one.hear(messages.Countdown), again.hear(messages.Countdown))
            assert (await one.hear(messages.Tick)).state.t == stood
            await asyncio.gather(one.hear(messages.Ended), again.hear(messages.Ended))

    kept = stored(server, asyncio.run(together(server, play)))
    assert [row.status for row in kept.episodes] == ["done"]


def test_a_participant_whose_partner_leaves_is_told_and_continues_with_an_agent(server: OwnServer) -> None:
    async def play(one: PairedPerson, two: PairedPerson) -> None:
        await start(one, two)
        while (await two.hear(messages.Tick)).state.t < 10:
            pass
        two.socket.transport.abort()
        assert (await one.hear(messages.Paused)).reason == "partner"
        ended = await one.hear(messages.Ended)
        assert not ended.passed
        page = await one.bot._get(one.bot.now)
        while not page.is_game:
            page = await one.bot.submit(page)
        async with at_the_game(one.bot) as alone:
            assert (await alone.hear(messages.Welcome)).partner == "agent"

    kept = stored(server, asyncio.run(together(server, play)))
    first, second = kept.episodes
    assert (first.status, first.end_reason) == ("aborted", "away")
    assert (second.participant_0 is None) != (second.participant_1 is None)
    assert second.agent_1 == "planner"
    assert [row.detail["why"] for row in kept.events if row.kind == "alone"] == ["partner_left"]


def test_the_wait_for_a_participant_who_does_not_press_start_is_limited(server: OwnServer) -> None:
    async def play(one: PairedPerson, two: PairedPerson) -> None:
        await one.say(messages.Ready())
        assert (await one.hear(messages.Paused)).reason == "partner"
        told = await two.hear(messages.Paused)
        assert told.reason == "lost"
        assert 0 < told.left_s <= 12, "who is awaited sees how long"
        assert not (await one.hear(messages.Ended)).passed

    kept = stored(server, asyncio.run(together(server, play)))
    assert [row.end_reason for row in kept.episodes] == ["away"]


def test_without_a_partner_a_participant_plays_with_the_fallback_agent(server: OwnServer) -> None:
    async def wait() -> Pair:
        bot = await somebody(server, 1)
        async with at_the_game(bot) as one:
            assert 0 < (await one.hear(messages.Waiting)).left_s <= 20
            assert await one.hear_close() == CloseCode.GAME_READY
        async with at_the_game(bot) as one:
            assert (await one.hear(messages.Welcome)).partner == "agent"
        await bot.close()
        return (bot,)

    kept = stored(server, asyncio.run(wait()))
    assert [row.agent_1 for row in kept.episodes] == ["planner"]


def test_without_a_partner_a_participant_is_paid_if_the_study_says_so(server: OwnServer) -> None:
    async def wait() -> Pair:
        bot = await somebody(server, 1, "paid")
        assert await bot.game().play() is None
        bot.journal.code = (await bot._get(bot.now)).code
        await bot.close()
        return (bot,)

    bots = asyncio.run(wait())
    assert re.fullmatch(r"KM-\w{4}-\w{4}", bots[0].journal.code or "")
    (person,) = stored(server, bots).people
    assert (person.status, person.completion_code) == ("returned", bots[0].journal.code)


def test_the_newest_tab_waits_and_the_older_one_gets_a_message(server: OwnServer) -> None:
    async def wait() -> None:
        bot = await somebody(server, 1)
        async with at_the_game(bot, "an-older-tab") as old:
            await old.hear(messages.Waiting)
            async with at_the_game(bot, "a-newer-tab") as new:
                await old.hear(messages.Superseded)
                await new.hear(messages.Waiting)
        await bot.close()

    asyncio.run(wait())
