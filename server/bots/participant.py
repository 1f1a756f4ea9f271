"""A simulated participant: completes a whole study over real HTTP and websockets, as a browser would. It has no access
to the database.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field
from random import Random
from typing import Final

from kitchenmind.client.pages import ParsedPage
from kitchenmind.client.study_client import StudyClient
from server.bots.answers import Respondent
from server.bots.cook import CookName, Traits
from server.bots.game_client import BotGame, BrowserFault, GameDropped, Journal

MAX_PAGES: Final = 200
_RELOADS_A_PAGE: Final = 0.05
_RELOADS_A_GAME: Final = 0.15
_LAST_RELOAD: Final = 300
_LAST_FAULT_AT: Final = 60


@dataclass(frozen=True)
class Habits:
    """The settings of a simulated participant, without its seed."""

    known: Mapping[str, str] = field(default_factory=dict)  # question -> the right answer, from the study file
    drop_after: int | None = None  # gives up at the page after so many; in a game, in the middle of it
    reloads: bool = True
    browser_faults: tuple[BrowserFault, ...] = ()  # what happens to it in every game, on purpose
    arrival: str = ""  # the recruitment parameters of the link
    simulated: bool = True
    secret: str = ""  # of a public server, which otherwise refuses bots
    cook: CookName = "foresight"  # how it plays
    tick_ms: float = 200.0  # of the study


class Bot:
    """One simulated participant. `take_part` takes it from the consent page to the completion code."""

    def __init__(self, base_url: str, study: str, seed: int, habits: Habits | None = None) -> None:
        self.journal = Journal()
        self.dropped = False
        self._habits = habits or Habits()
        self._traits = Traits.drawn(seed, self._habits.cook, tick_ms=self._habits.tick_ms)
        self._respondent = Respondent(self._traits, self._habits.known)
        self._chance = Random(f"habits {seed}")  # noqa: S311 - a seed makes a run repeatable
        self._client = StudyClient(
            base_url, study, self._habits.arrival, self._habits.secret, accept="text/html"
        )  # what people get
        self._client.simulated = self._habits.simulated
        self._client.retry = self._lost

    def _lost(self) -> None:
        self.journal.reconnects += 1

    @property
    def now(self) -> str:
        return self._client.now

    @property
    def token(self) -> str:
        """The value of the cookie; empty before consent."""
        return self._client.token

    async def take_part(self) -> Journal:
        """Complete the study; return the journal with the completion code. Raises RuntimeError if there is no next
        page."""
        async with self._client:
            return await self.continue_from(await self.consent())

    async def continue_from(self, page: ParsedPage) -> Journal:
        """Continue from this page to the code, or until the participant drops out or is screened out."""
        for count in range(MAX_PAGES):
            if page.has_ended_early:
                self.dropped = True
                return self.journal
            if page.code is not None:
                self.journal.code = page.code
                return self.journal
            gives_up = self._habits.drop_after is not None and count >= self._habits.drop_after
            if gives_up and not page.is_game:
                self.dropped = True
                return self.journal
            try:
                page = await self._play(gives_up) if page.is_game else await self.submit(await self._reloaded(page))
            except GameDropped:
                self.dropped = True
                return self.journal
        raise RuntimeError(f"no completion code after {MAX_PAGES} pages: {self.journal.pages[-5:]}")

    async def close(self) -> None:
        """Close the connections; the cookie stays."""
        await self._client.close()

    def game(self) -> BotGame:
        """Return a game client with this participant's cookie."""
        return BotGame(self._client.socket_url, self._client.cookie, self.journal, self._traits)

    async def consent(self) -> ParsedPage:
        """Consent; return the next page."""
        page = await self._client.open()
        fields = self._client.fields(page, self._client.consent_path)
        return await self._client.consent(page, self._respondent.fill(fields, None, frozenset()))

    async def _play(self, gives_up: bool) -> ParsedPage:
        self.journal.pages.append("game")
        game = self.game()
        moment = self._chance.randrange(1, _LAST_RELOAD)
        if gives_up:
            game.drop_at = moment
        elif self._habits.browser_faults:
            game.browser_faults = {
                self._chance.randrange(1, _LAST_FAULT_AT): fault for fault in self._habits.browser_faults
            }
        elif self._habits.reloads and self._chance.random() < _RELOADS_A_GAME:
            game.browser_faults[moment] = "reload"
        await game.play()
        return await self._get(self.now)

    async def _reloaded(self, page: ParsedPage) -> ParsedPage:
        """Reload the page sometimes: it must be the same one."""
        if not self._habits.reloads or page.faults or self._chance.random() >= _RELOADS_A_PAGE:
            return page
        self.journal.browser_faults["page_reload"] = self.journal.browser_faults.get("page_reload", 0) + 1
        again = await self._get(self.now)
        if again.step(self.now) != page.step(self.now):
            self.journal.violations.append(f"a reload led from {page.step(self.now)} to {again.step(self.now)}")
        return again

    async def submit(self, page: ParsedPage) -> ParsedPage:
        """Fill in and submit the page; return the next page."""
        fields = self._client.fields(page, self.now)
        last = self.journal.impressions[-1] if self.journal.impressions else None
        filled = self._respondent.fill(fields, last, page.faults)
        step = str(filled.get("step", "?"))
        if step in self.journal.pages and not page.faults:
            self.journal.violations.append(f"page {step} came twice")
        self.journal.pages.append(step)
        self.journal.answers.append((step, {k: v for k, v in filled.items() if fields[k][0].kind != "hidden"}))
        return await self._client.post(self.now, filled)

    async def _get(self, path: str) -> ParsedPage:
        return await self._client.get(path)
