"""A simulated participant: walks a whole study over real HTTP and sockets, as a browser would. Knows no database."""

import asyncio
import time
from collections.abc import Mapping
from dataclasses import dataclass, field
from html.parser import HTMLParser
from random import Random
from typing import Any, Final

import httpx

from server.bots.answers import Field, Fields, Respondent
from server.bots.cook import Traits
from server.bots.game_client import BotGame, BrowserFault, GameDropped, Journal, origin_of
from server.web.auth import BOT_MARK, bot_mark

MOST_PAGES: Final = 200
_RELOADS_A_PAGE: Final = 0.05
_RELOADS_A_GAME: Final = 0.15
_LAST_RELOAD: Final = 300
_LAST_FAULT_AT: Final = 60
_AGAIN_WITHIN_S: Final = 60.0


class ParsedPage(HTMLParser):
    """The parts of a page that a participant acts on: forms, the game, the completion code."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.forms: list[tuple[str, Fields]] = []  # action, field -> its inputs
        self.faults: frozenset[str] = frozenset()
        self.is_game = False
        self.code: str | None = None
        self._in_code = False
        self.feed(text)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        values = {name: value or "" for name, value in attrs}
        if values.get("id") == "game-config":
            self.is_game = True
        self._in_code = tag == "output" and values.get("id") == "code"
        self._own_code = values.get("data-own", "") if self._in_code else ""
        if tag == "fieldset" and "missing" in values.get("class", "").split():
            self.faults |= {values.get("id", "").removeprefix("q-")}
        if tag == "form" and values.get("method", "").lower() == "post":
            self.forms.append((values.get("action", ""), {}))
        elif tag in ("input", "textarea", "select", "button") and values.get("name") and self.forms:
            kind = values.get("type", "text") if tag == "input" else tag
            new = Field(kind, values.get("value", ""), values)
            self.forms[-1][1].setdefault(values["name"], []).append(new)

    def handle_data(self, data: str) -> None:
        if self._in_code and data.strip():
            self.code = self._own_code or data.strip()  # a recruiter's code is everybody's

    def form(self, path: str) -> Fields | None:
        """The fields of the form with this address, which may lie behind a path of the server."""
        return next((fields for action, fields in self.forms if action.endswith(path)), None)

    def step(self, path: str) -> str:
        """The key of the step that this page is; empty for one that is none."""
        fields = self.form(path) or {}
        return fields["step"][0].value if "step" in fields else ""


@dataclass(frozen=True)
class Habits:
    """What a simulated participant is given besides its seed."""

    known: Mapping[str, str] = field(default_factory=dict)  # question -> the right answer, from the study file
    drop_after: int | None = None  # gives up at the page after so many; in a game, in the middle of it
    reloads: bool = True
    browser_faults: tuple[BrowserFault, ...] = ()  # what happens to it in every game, on purpose
    arrival: str = ""  # the recruitment parameters of the link
    simulated: bool = True
    secret: str = ""  # of a public server, which believes nobody else that a bot comes


class Bot:
    """One simulated participant. `walk` goes from the consent page to the completion code."""

    def __init__(self, base_url: str, study: str, seed: int, habits: Habits | None = None) -> None:
        self.journal = Journal()
        self.dropped = False
        self._base, self._study = base_url.rstrip("/"), study
        self._habits = habits or Habits()
        self._traits = Traits.drawn(seed)
        self._respondent = Respondent(self._traits, self._habits.known)
        self._chance = Random(f"habits {seed}")  # noqa: S311 - a seed makes a run repeatable
        self._client = httpx.AsyncClient(
            base_url=self._base,
            follow_redirects=True,
            headers={"Accept": "text/html", "Origin": origin_of(self._base)},
            timeout=60,
        )

    @property
    def now(self) -> str:
        return f"/s/{self._study}/now"

    @property
    def token(self) -> str:
        """What the cookie carries; empty before consent."""
        return next((cookie.value or "" for cookie in self._client.cookies.jar), "")

    async def walk(self) -> Journal:
        """The whole way; what was seen, with the completion code. Raises RuntimeError where there is no way on."""
        async with self._client:
            return await self.go_on(await self.consent())

    async def go_on(self, page: ParsedPage) -> Journal:
        """From this page to the code, or to where the participant gives up."""
        for count in range(MOST_PAGES):
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
        raise RuntimeError(f"no completion code after {MOST_PAGES} pages: {self.journal.pages[-5:]}")

    async def close(self) -> None:
        """Let go of the connections; the cookie stays."""
        await self._client.aclose()

    def game(self) -> BotGame:
        """A game connection with this participant's cookie."""
        cookie = "; ".join(f"{name}={value}" for name, value in self._client.cookies.items())
        url = f"ws{self._base.removeprefix('http')}/s/{self._study}/socket"
        return BotGame(url, cookie, self.journal, self._traits)

    async def consent(self) -> ParsedPage:
        """Agrees; the page after it."""
        page = await self._get(f"/s/{self._study}{self._habits.arrival}")
        fields = page.form(f"/s/{self._study}/consent")
        if fields is None:
            raise RuntimeError("the consent page has no form")
        filled = self._respondent.fill(fields, None, frozenset())
        secret, visit = self._habits.secret, str(filled.get("visit", ""))
        if self._habits.simulated:
            filled |= {"simulated": "yes", BOT_MARK: bot_mark(secret.encode(), visit) if secret else ""}
        return await self._post(f"/s/{self._study}/consent", filled)

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
        """Now and then a page is loaded again: it must be the same one."""
        if not self._habits.reloads or page.faults or self._chance.random() >= _RELOADS_A_PAGE:
            return page
        self.journal.browser_faults["page_reload"] = self.journal.browser_faults.get("page_reload", 0) + 1
        again = await self._get(self.now)
        if again.step(self.now) != page.step(self.now):
            self.journal.violations.append(f"a reload led from {page.step(self.now)} to {again.step(self.now)}")
        return again

    async def submit(self, page: ParsedPage) -> ParsedPage:
        """Fill the page in and send it; the page after it."""
        fields = page.form(self.now)
        if fields is None:
            raise RuntimeError("a page has neither form nor game nor code")
        last = self.journal.impressions[-1] if self.journal.impressions else None
        filled = self._respondent.fill(fields, last, page.faults)
        step = str(filled.get("step", "?"))
        if step in self.journal.pages and not page.faults:
            self.journal.violations.append(f"page {step} came twice")
        self.journal.pages.append(step)
        self.journal.answers.append((step, {k: v for k, v in filled.items() if fields[k][0].kind != "hidden"}))
        return await self._post(self.now, filled)

    async def _get(self, path: str) -> ParsedPage:
        return self._page(await self._ask("GET", path))

    async def _post(self, path: str, fields: dict[str, Any]) -> ParsedPage:
        return self._page(await self._ask("POST", path, fields))

    async def _ask(self, method: str, path: str, fields: dict[str, Any] | None = None) -> httpx.Response:
        """Ask again while the server is away, as somebody does who sees that a page does not come."""
        deadline = time.monotonic() + _AGAIN_WITHIN_S
        while True:
            try:
                return await self._client.request(method, path, data=fields)
            except httpx.TransportError:
                if time.monotonic() > deadline:
                    raise
                self.journal.reconnects += 1
                await asyncio.sleep(0.2)

    @staticmethod
    def _page(response: httpx.Response) -> ParsedPage:
        page = ParsedPage(response.text)
        if response.status_code >= 400 and not page.faults:
            raise RuntimeError(f"{response.request.method} {response.url.path} answered {response.status_code}")
        return page
