"""Simulated participants: they walk a whole study over real HTTP and sockets, as a browser would."""

import random
from html.parser import HTMLParser
from typing import Any, Final

import httpx

from server.bot_game import BotGame, Journal

MOST_PAGES: Final = 200


class Page(HTMLParser):
    """The parts of a page that a participant acts on: forms, the game, the completion code."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.forms: list[tuple[str, dict[str, list[tuple[str, str]]]]] = []  # action, field -> (kind, value)
        self.is_game = False
        self.code: str | None = None
        self._in_code = False
        self.feed(text)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        values = {name: value or "" for name, value in attrs}
        if values.get("id") == "game-config":
            self.is_game = True
        self._in_code = tag == "output" and values.get("id") == "code"
        if tag == "form" and values.get("method", "").lower() == "post":
            self.forms.append((values.get("action", ""), {}))
        elif tag in ("input", "textarea", "select", "button") and values.get("name") and self.forms:
            kind = values.get("type", "text") if tag == "input" else tag
            self.forms[-1][1].setdefault(values["name"], []).append((kind, values.get("value", "")))

    def handle_data(self, data: str) -> None:
        if self._in_code and data.strip():
            self.code = data.strip()

    def form(self, path: str) -> dict[str, list[tuple[str, str]]] | None:
        return next((fields for action, fields in self.forms if action == path), None)


class Bot:
    """One simulated participant. `walk` goes from the consent page to the completion code."""

    def __init__(self, base_url: str, study: str, seed: int, simulated: bool = True) -> None:
        self.journal = Journal()
        self._base, self._study, self._simulated = base_url.rstrip("/"), study, simulated
        self._chance = random.Random(seed)  # noqa: S311 - a seed makes a run repeatable
        self._client = httpx.AsyncClient(
            base_url=self._base,
            follow_redirects=True,
            headers={"Accept": "text/html", "Origin": self._base},
            timeout=30,
        )

    async def walk(self) -> Journal:
        """The whole way; what was seen, with the completion code. Raises RuntimeError where there is no way on."""
        async with self._client:
            page = await self.consent()
            for _ in range(MOST_PAGES):
                if page.code is not None:
                    self.journal.code = page.code
                    return self.journal
                page = await self._play() if page.is_game else await self.submit(page)
        raise RuntimeError(f"no completion code after {MOST_PAGES} pages: {self.journal.pages[-5:]}")

    async def close(self) -> None:
        """Lets go of the connections; the cookie stays."""
        await self._client.aclose()

    def game(self) -> BotGame:
        """A game connection with this participant's cookie."""
        cookie = "; ".join(f"{name}={value}" for name, value in self._client.cookies.items())
        url = f"ws{self._base.removeprefix('http')}/s/{self._study}/socket"
        return BotGame(url, cookie, self.journal, self._chance)

    async def consent(self) -> Page:
        """Agrees; the page after it."""
        page = await self._get(f"/s/{self._study}")
        fields = page.form(f"/s/{self._study}/consent")
        if fields is None:
            raise RuntimeError("the consent page has no form")
        extra = {"simulated": "yes"} if self._simulated else {}
        return await self._post(f"/s/{self._study}/consent", self._filled(fields) | extra)

    async def _play(self) -> Page:
        self.journal.pages.append("game")
        await self.game().play()
        return await self._get(f"/s/{self._study}/now")

    async def submit(self, page: Page) -> Page:
        """Fills the page in and sends it; the page after it."""
        fields = page.form(f"/s/{self._study}/now")
        if fields is None:
            raise RuntimeError("a page has neither form nor game nor code")
        filled = self._filled(fields)
        self.journal.pages.append(str(filled.get("step", "?")))
        return await self._post(f"/s/{self._study}/now", filled)

    def _filled(self, fields: dict[str, list[tuple[str, str]]]) -> dict[str, Any]:
        """An answer to everything: hidden fields as they are, boxes ticked, one of each choice."""
        filled: dict[str, Any] = {}
        for name, options in fields.items():
            kind = options[0][0]
            values = [value for _, value in options]
            if kind in ("radio", "select"):
                filled[name] = self._chance.choice(values)
            elif kind == "checkbox":
                filled[name] = values
            elif kind == "number":
                filled[name] = "30"
            elif kind in ("hidden", "button"):
                filled[name] = values[0]
            else:
                filled[name] = "-"
        return filled

    async def _get(self, path: str) -> Page:
        return self._page(await self._client.get(path))

    async def _post(self, path: str, fields: dict[str, Any]) -> Page:
        return self._page(await self._client.post(path, data=fields))

    @staticmethod
    def _page(response: httpx.Response) -> Page:
        if response.status_code >= 400:
            raise RuntimeError(f"{response.request.method} {response.url.path} answered {response.status_code}")
        return Page(response.text)
