"""A participant over HTTP: consent, the pages and forms of every step, and the game of the step that is one."""

import asyncio
import os
import ssl
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import cache
from types import TracebackType
from typing import Any, Final, Self, TypeVar

import httpx
import msgspec

from kitchenmind.client.game_client import GameClient, origin_of
from kitchenmind.client.pages import Fields, ParsedPage, filled_in, page_of_json
from server.play import messages

Game = TypeVar("Game", bound=GameClient)
MAX_PAGES: Final = 200
_RETRY_TIMEOUT_S: Final = 60.0


class ClientFailed(RuntimeError):
    """The participant cannot continue; the text says at which page and why."""


def _certificates() -> ssl.SSLContext:
    """Return the trusted certificates, those that the environment names where it names some."""
    return _certificates_of(os.environ.get("SSL_CERT_FILE"), os.environ.get("SSL_CERT_DIR"))


@cache
def _certificates_of(file: str | None, folder: str | None) -> ssl.SSLContext:  # noqa: ARG001 - httpx reads them itself
    """Read them once for each place: a client that reads them takes 25 ms longer."""
    return httpx.create_ssl_context()


class StudyClient:
    """One participant of one study. Keeps the cookie; use it as `async with StudyClient(url, study) as client`."""

    def __init__(
        self, base_url: str, study: str, arrival: str = "", secret: str = "", *, accept: str = "application/json"
    ) -> None:
        """`base_url`: as the browser shows it; `arrival`: the parameters of a recruiter's link, `?PROLIFIC_PID=...`;
        `secret`: of a public server, which otherwise refuses programs. The participant is stored as simulated, so that
        no analysis takes it for a person. `accept`: how pages come; `text/html`: as a browser gets them."""
        self.base_url, self.study = base_url.rstrip("/"), study
        self.arrival, self.secret = arrival, secret
        self.simulated = True
        self.retry: Callable[[], None] = lambda: None  # called when the server did not answer and is asked again
        self._http = httpx.AsyncClient(
            base_url=self.base_url,
            follow_redirects=True,
            headers={"Accept": accept, "Origin": origin_of(self.base_url)},
            timeout=60,
            verify=_certificates(),
        )

    async def __aenter__(self) -> Self:
        return self

    async def __aexit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        await self.close()

    async def close(self) -> None:
        """Close the connections; the cookie stays."""
        await self._http.aclose()

    @property
    def now(self) -> str:
        """The path of the current step."""
        return f"/s/{self.study}/now"

    @property
    def consent_path(self) -> str:
        return f"/s/{self.study}/consent"

    @property
    def cookies(self) -> httpx.Cookies:
        return self._http.cookies

    @property
    def token(self) -> str:
        """The value of the cookie; empty before consent."""
        return next((cookie.value or "" for cookie in self._http.cookies.jar), "")

    async def open(self) -> ParsedPage:
        """Return the consent page. Raises ClientFailed."""
        return await self.get(f"/s/{self.study}{self.arrival}")

    async def consent(self, page: ParsedPage | None = None, answers: Mapping[str, Any] | None = None) -> ParsedPage:
        """Agree to take part; return the page after it. `page`: the consent page, if it is open. Raises ClientFailed,
        also if the study is full."""
        path = self.consent_path
        page = page or await self.open()
        sent = filled_in(self.fields(page, path), answers or {})
        if self.simulated:
            sent |= {"simulated": "yes", **self._mark(str(sent.get("visit", "")))}
        return await self.post(path, sent)

    def _mark(self, visit: str) -> dict[str, str]:
        if not self.secret:
            return {}
        from server.web.auth import BOT_MARK, bot_mark

        return {BOT_MARK: bot_mark(self.secret.encode(), visit)}

    async def load(self) -> ParsedPage:
        """Return the page of the current step."""
        return await self.get(self.now)

    async def submit(self, page: ParsedPage, answers: Mapping[str, Any] | None = None) -> ParsedPage:
        """Fill the page in and send it; return the page after it, or the same one with `faults`. `answers`: question ->
        answer; the first or lowest one is given to every other question. Raises ClientFailed."""
        return await self.post(self.now, filled_in(self.fields(page, self.now), answers or {}))

    def fields(self, page: ParsedPage, path: str) -> Fields:
        """Return the fields of the page's form. Raises ClientFailed."""
        fields = page.form(path)
        if fields is None:
            if path == self.consent_path:
                raise ClientFailed(
                    f"{path} has no consent form: the study may be closed, full or paused. Look at its page in "
                    "a browser"
                )
            raise ClientFailed(
                "a page has neither form nor game nor code: the study has ended here, for example after a failed "
                "attention check"
            )
        return fields

    def game(self, kind: type[Game] = GameClient) -> Game:  # type: ignore[assignment]
        """Return a player of the current step's game, with this participant's cookie."""
        return kind(self.socket_url, self.cookie)

    @property
    def socket_url(self) -> str:
        return f"ws{self.base_url.removeprefix('http')}/s/{self.study}/socket"

    @property
    def cookie(self) -> str:
        """The header `Cookie` of this participant."""
        return "; ".join(f"{name}={value}" for name, value in self._http.cookies.items())

    async def get(self, path: str) -> ParsedPage:
        """Return the page at `path`. Raises ClientFailed."""
        return _page(await self._ask("GET", path))

    async def post(self, path: str, fields: dict[str, Any]) -> ParsedPage:
        """Send a form; return the page after it. Raises ClientFailed."""
        return _page(await self._ask("POST", path, fields))

    async def _ask(self, method: str, path: str, fields: dict[str, Any] | None = None) -> httpx.Response:
        """Send a request, again if the server cannot be reached, as a person would reload a page."""
        deadline = time.monotonic() + _RETRY_TIMEOUT_S
        while True:
            try:
                return await self._http.request(method, path, data=fields)
            except httpx.TransportError:
                if time.monotonic() > deadline:
                    raise
                self.retry()
                await asyncio.sleep(0.2)


def _page(response: httpx.Response) -> ParsedPage:
    is_json = response.headers.get("content-type", "").startswith("application/json")
    try:
        page = page_of_json(response.content) if is_json else ParsedPage(response.text)
    except msgspec.DecodeError:  # an error: {"detail": ...}
        page = ParsedPage("")
    if response.status_code >= 400 and not page.faults:
        raise ClientFailed(f"{response.request.method} {response.url.path} answered {response.status_code}")
    return page


@dataclass
class StudyResult:
    """The pages of one participant in a study. `code` is None if there was no code at the end."""

    code: str | None = None
    games: list[messages.Ended] = field(default_factory=list)
    pages: int = 0


async def take_part(
    url: str, study: str, player: type[GameClient] = GameClient, answers: Mapping[str, Any] | None = None, **more: str
) -> StudyResult:
    """Take part in a study from consent to the completion code. `player` plays every game, `answers` are given on every
    page that asks for them, `more` goes to `StudyClient`. Raises ClientFailed."""
    done = StudyResult()
    async with StudyClient(url, study, **more) as client:
        page = await client.consent(answers=answers)
        while page.code is None:
            done.pages += 1
            if done.pages > MAX_PAGES:
                raise ClientFailed(f"no completion code after {MAX_PAGES} pages")
            if page.faults:
                raise ClientFailed(f"the page was returned: it needs other answers to {', '.join(sorted(page.faults))}")
            if page.is_game:
                ended = await client.game(player).play()
                done.games += [] if ended is None else [ended]
                page = await client.load()
            else:
                page = await client.submit(page, answers)
    done.code = page.code
    return done
