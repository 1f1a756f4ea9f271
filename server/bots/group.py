"""N simulated participants at one server: arrivals, dropouts, and the outcome. The server must be running."""

import asyncio
import hashlib
from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from random import Random
from typing import Any, Final
from urllib.parse import urlencode

from sqlalchemy import Connection

from kitchenmind.client.pages import ParsedPage
from server.bots import invariants
from server.bots.cook import CookName
from server.bots.foresight.cook import prepare
from server.bots.game_client import BrowserFault
from server.bots.invariants import Claim
from server.bots.participant import Bot, Habits
from server.store import participants
from server.store.database import Database
from server.study.definition import Study
from server.study.order import derived_seed
from server.study.steps import steps

AT_ONCE: Final = 100  # more would only wait for each other
_PAGES_UNKNOWN: Final = 12
_FULL: Final = "answered 409"  # the study is full: a participant who arrives now has not started


@dataclass(frozen=True)
class BotGroup:
    """The participants and their study."""

    number: int
    study_name: str
    study: Study | None = None  # None: the file is not known, only the address
    dropout: float = 0.0
    seed: int = 0
    browser_faults: tuple[BrowserFault, ...] = ()  # faults for every participant in every game
    secret: str = ""  # of the server, to which they prove with it that they are bots
    cook: CookName = "foresight"  # how they play


@dataclass
class GroupOutcome:
    """The outcome, as printed by `kitchenmind bots --json`."""

    started: int = 0
    completed: int = 0
    dropped: int = 0
    by_condition: dict[str, int] = field(default_factory=dict)  # of those who completed; empty without the database
    episodes: int = 0  # played to their end, without tutorials
    violations: list[str] = field(default_factory=list)
    late_timesteps: int = 0  # of these episodes, in which the models failed or were late, so that the partner waited


@dataclass
class _One:
    """One simulated participant and its outcome."""

    bot: Bot
    came: bool = False


async def simulate(
    group: BotGroup,
    url: str,
    database: Database | None,
    report: Callable[[int, int], None] | None = None,
    meet: Callable[[Sequence[Bot]], None] | None = None,
) -> list[Bot]:
    """Run all participants through the study; return those who consented, in order of consent. `database`: read only,
    checked when a code is on the screen. `report(done, number)` is called after each participant, `meet` before each
    arrives. Violations are in `journal.violations`."""
    everyone = [
        _One(Bot(url, group.study_name, derived_seed(group.seed, "bot", k), _habits(group, k)))
        for k in range(group.number)
    ]
    if group.cook in ("foresight", "credulous"):
        prepare()
    if meet is not None:
        meet([one.bot for one in everyone])
    turns = [asyncio.Event() for _ in range(group.number + 1)]
    turns[0].set()
    places = asyncio.Semaphore(AT_ONCE)
    done = 0

    async def one(number: int) -> None:
        nonlocal done
        async with places:
            await _take_part(everyone[number], turns[number], turns[number + 1], database)
        done += 1
        if report is not None:
            report(done, group.number)

    await asyncio.gather(*(one(number) for number in range(group.number)))
    return [one.bot for one in everyone if one.came or one.bot.journal.violations]


async def _take_part(one: _One, turn: asyncio.Event, following: asyncio.Event, database: Database | None) -> None:
    """Consent in order, so that a repeated run assigns the same conditions; then continue at its own pace."""
    journal = one.bot.journal
    await turn.wait()
    try:
        try:
            page: ParsedPage | None = await one.bot.consent()
            one.came = bool(one.bot.token)
        finally:
            following.set()
        if one.came and page is not None:
            await one.bot.continue_from(page)
        if journal.code is not None and database is not None:
            journal.violations += await database.read(invariants.broken_at_code, Claim(one.bot.token, journal))
    except Exception as error:  # noqa: BLE001 - a failure of one is reported and does not stop the others
        if one.came or _FULL not in str(error):
            journal.violations.append(f"there was no way on: {type(error).__name__}: {error}")
    finally:
        await one.bot.close()


def check_outcome(bots: Sequence[Bot], database: Database | None, study: Study | None = None) -> GroupOutcome:
    """Count the participants, and check every guarantee against what they saw and, if there is a database, what is
    stored. `study`: the study they took part in, if known."""
    outcome = GroupOutcome()
    journals = [bot.journal for bot in bots]
    for bot in bots:
        outcome.started += bool(bot.token)
        outcome.completed += bot.journal.code is not None
        outcome.dropped += bool(bot.token) and bot.journal.code is None
        games = bot.journal.games
        outcome.episodes += bot.journal.rounds_played
        outcome.late_timesteps += sum(games[episode].kind == "episode" for episode, _ in bot.journal.unanswered)
        outcome.violations += invariants.broken_in_journal(bot.journal, study.blocks if study else 1)
    outcome.violations += invariants.broken_codes(journals)
    if database is not None:
        outcome.violations += database.read_now(_stored, [Claim(bot.token, bot.journal) for bot in bots if bot.token])
        outcome.by_condition = database.read_now(_by_condition, [bot.token for bot in bots])
    return outcome


def _stored(connection: Connection, claims: Sequence[Claim]) -> list[str]:
    return [broken for claim in claims for broken in invariants.broken_in_store(connection, claim)]


def _by_condition(connection: Connection, tokens: Sequence[str]) -> dict[str, int]:
    found = (participants.by_token(connection, token) for token in tokens)
    everyone = [participant for participant in found if participant is not None]
    completed = Counter(participant.condition for participant in everyone if participant.status == "completed")
    return {condition: completed[condition] for condition in sorted({one.condition for one in everyone})}


def _habits(group: BotGroup, number: int) -> Habits:
    chance = Random(f"crowd {group.seed} {number}")  # noqa: S311 - a seed makes a run repeatable, across versions too
    pages = _PAGES_UNKNOWN
    if group.study is not None:
        pages = len(steps(group.study, group.study.conditions[0].name, 0)) - 1
    drop_after = chance.randrange(pages) if chance.random() < group.dropout else None
    known = dict(_right_answers(group.study)) if group.study is not None else {}
    return Habits(
        known,
        drop_after,
        arrival=_arrival(group, number),
        browser_faults=group.browser_faults,
        secret=group.secret,
        cook=group.cook,
        tick_ms=200.0 if group.study is None else group.study.game.tick_ms,
    )


def _right_answers(study: Study) -> Iterator[tuple[str, str]]:
    """Return the correct answers to the quiz and the attention checks."""
    pages = [*study.questionnaires.values(), *([study.quiz] if study.quiz else [])]
    for question in (question for page in pages for question in page.asks):
        right = getattr(question, "correct", None) or getattr(question, "attention", None)
        if right is not None:
            yield question.key, str(right)


def _arrival(group: BotGroup, number: int) -> str:
    """Return the parameters of a recruiter's link, if the study needs one."""
    parameter = group.study.recruitment.person_parameter if group.study is not None else None
    if group.study is None or parameter is None:
        return ""
    values: Mapping[str, Any] = {parameter: _person(group.study, f"bot-{group.seed}-{number}", number)}
    return "?" + urlencode(dict(values) | dict.fromkeys(group.study.recruitment.extra_parameters, "simulated"))


def _person(study: Study, name: str, number: int) -> str:
    """Return a different id for every number, in the recruiter's format. Raises ValueError if none of ours matches
    it."""
    digest = hashlib.sha256(name.encode()).hexdigest()
    count = int(digest[:8], 16)
    candidates = (name, digest[:24], f"A{digest[:13].upper()}", f"bot{count}", str(count), f"{number + 1:03d}")
    for one in candidates:
        if study.recruitment.person_of(one) is not None:
            return one
    raise ValueError(f"bots have no id that fits person_pattern: {study.recruitment.person_pattern!r}. Try without it.")
