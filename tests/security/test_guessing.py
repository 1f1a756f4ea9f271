"""Guessing passwords and codes: the limit holds for simultaneous requests, and no attacker can lock the owner out. The
whole application behind a proxy, as in production: the proxy tells the client's address.
"""

import asyncio
import re
from collections import Counter
from collections.abc import Iterator

import httpx
import pytest
from argon2 import PasswordHasher

import kitchenmind
from server.store import admins
from server.store.attempts import LIMIT
from server.web.guess_limits import CODE, MAX_WAITING, MAX_WAITING_OF_ONE, PASSWORD_OF_KNOWN, Busy, Hashing, Origin
from server.web.guess_limits import PASSWORD as BY_PASSWORD
from tests.support.live_server import LiveServer
from tests.support.real_server import SHORT_STUDY

PUBLIC = "https://lab.example.org"
PASSWORD = "long enough for a test"
QUICK_HASH = PasswordHasher(time_cost=1, memory_cost=8, parallelism=1).hash(PASSWORD)
OWNER, ATTACKER = "198.51.100.7", "203.0.113.9"


@pytest.fixture(scope="module")
def live(tmp_path_factory: pytest.TempPathFactory) -> Iterator[LiveServer]:
    folder = tmp_path_factory.mktemp("guessing")
    study = SHORT_STUDY.replace("planner}", "planner, predictor: random}")
    with LiveServer(folder, 1.0, study, mode="production", public_url=PUBLIC) as running:
        yield running


@pytest.fixture
def ada(live: LiveServer) -> str:
    """An account without any attempts."""
    database = live.app.state.services.web.database
    for name in ("ada", "mara"):
        database.write_now(admins.remove, name)
        database.write_now(admins.create, name, QUICK_HASH, "own")
    return "ada"


def browser(live: LiveServer, address: str) -> httpx.AsyncClient:
    """Somebody at this address; the proxy in front tells it, whatever the browser claims."""
    headers = {"accept": "text/html", "origin": PUBLIC, "host": "lab.example.org", "x-forwarded-for": address}
    return httpx.AsyncClient(base_url=live.url, headers=headers, timeout=60)


async def sign_in(client: httpx.AsyncClient, name: str, *passwords: str) -> list[int]:
    """All at the same moment, with one form."""
    page = await client.get("/admin/login")
    token = re.findall(r'name="form_token" value="([^"]*)"', page.text)[0]
    forms = [{"form_token": token, "name": name, "password": password} for password in passwords]
    answers = await asyncio.gather(*(client.post("/admin/login", data=form) for form in forms))
    for answer in answers:  # httpx keeps no cookie of TLS that came without it
        for cookie in answer.headers.get_list("set-cookie"):
            client.headers["cookie"] = f"{client.headers.get('cookie', '')}; {cookie.partition(';')[0]}".strip("; ")
    return [answer.status_code for answer in answers]


def wrong(times: int) -> list[str]:
    return [f"guess number {number}" for number in range(times)]


async def test_of_thirty_guesses_at_once_five_are_checked(live: LiveServer, ada: str) -> None:
    async with browser(live, ATTACKER) as attacker:
        statuses = Counter(await sign_in(attacker, ada, *wrong(29), PASSWORD))
        assert statuses == {401: LIMIT, 429: 30 - LIMIT} or statuses == {401: LIMIT, 303: 1, 429: 29 - LIMIT}
        assert Counter(await sign_in(attacker, "nobody", *wrong(30))) == {401: LIMIT, 429: 30 - LIMIT}


async def test_an_address_that_a_browser_claims_gives_no_more_tries(live: LiveServer, ada: str) -> None:
    """As a proxy writes it that adds the address it sees to whatever came."""
    for number in range(LIMIT + 1):
        async with browser(live, f"192.0.2.{number}, {ATTACKER}") as attacker:
            assert await sign_in(attacker, ada, "a guess") == [401 if number < LIMIT else 429]
    async with browser(live, ATTACKER) as attacker, browser(live, f"{ATTACKER}, {OWNER}") as owner:
        assert await sign_in(attacker, ada, PASSWORD) == [429]
        assert await sign_in(owner, ada, PASSWORD) == [303]


async def test_an_ipv6_network_has_the_tries_of_one_address(live: LiveServer, ada: str) -> None:
    for number in range(LIMIT + 1):
        async with browser(live, f"2001:db8:0:1::{number:x}") as attacker:
            assert await sign_in(attacker, ada, "a guess") == [401 if number < LIMIT else 429]
    async with browser(live, "2001:db8:0:2::1") as owner:
        assert await sign_in(owner, ada, PASSWORD) == [303]


async def test_right_passwords_use_up_no_tries(live: LiveServer, ada: str) -> None:
    async with browser(live, OWNER) as owner:
        assert await sign_in(owner, ada, *wrong(LIMIT - 1)) == [401] * (LIMIT - 1)
        for _ in range(LIMIT + 1):
            assert await sign_in(owner, ada, PASSWORD) == [303]
        assert await sign_in(owner, "mara", PASSWORD) == [303]


async def test_guesses_from_another_address_lock_nobody_out(live: LiveServer, ada: str) -> None:
    async with browser(live, ATTACKER) as attacker, browser(live, OWNER) as owner, browser(live, ATTACKER) as shared:
        await sign_in(attacker, ada, *wrong(29))
        assert await sign_in(attacker, ada, PASSWORD) == [429]
        assert await sign_in(owner, ada, PASSWORD) == [303], "from another address"
        assert await sign_in(shared, "mara", PASSWORD) == [303], "another account, from the attacker's address"


async def test_a_browser_that_was_signed_in_before_can_sign_in_while_others_guess(live: LiveServer, ada: str) -> None:
    async with browser(live, ATTACKER) as known, browser(live, ATTACKER) as attacker:
        assert await sign_in(known, ada, PASSWORD) == [303]
        await sign_in(attacker, ada, *wrong(10))
        assert await sign_in(attacker, ada, PASSWORD) == [429]
        assert await sign_in(known, ada, PASSWORD) == [303]
        at_once = await sign_in(known, ada, *wrong(LIMIT + 1))
        assert Counter(at_once) == {401: LIMIT, 429: 1}, "and has no more tries than others"
        attacker.headers["cookie"] = "__Secure-browser=" + "0" * 32 + "." + "0" * 64
        assert await sign_in(attacker, ada, PASSWORD) == [429], "nobody makes such a mark"


async def test_reset_lets_an_account_sign_in_at_once(
    live: LiveServer, ada: str, capsys: pytest.CaptureFixture[str]
) -> None:
    async with browser(live, ATTACKER) as owner:
        assert await sign_in(owner, ada, *wrong(29), PASSWORD)
        assert await sign_in(owner, ada, PASSWORD) == [429]
        assert await asyncio.to_thread(kitchenmind.main, ["admin", "--database", live.database, "reset", ada]) == 0
        password = re.findall(r"password: (\S+)", capsys.readouterr().out)[0]
        assert await sign_in(owner, ada, password) == [303]


async def test_of_thirty_codes_at_once_five_are_looked_up(live: LiveServer) -> None:
    async with browser(live, ATTACKER) as attacker:
        page = await attacker.get("/s/short/withdraw")
        token = re.findall(r'name="form_token" value="([^"]*)"', page.text)[0]
        forms = [{"form_token": token, "code": f"KM-{number}"} for number in range(30)]
        answers = await asyncio.gather(*(attacker.post("/s/short/withdraw", data=form) for form in forms))
        assert Counter(answer.status_code for answer in answers) == {422: LIMIT, 429: 30 - LIMIT}


def test_waiting_password_checks_are_bounded_and_known_browsers_have_places() -> None:
    hashing = Hashing()
    places = []

    def take(origin: Origin) -> None:
        place = hashing.place(origin)
        place.__enter__()
        places.append(place)

    for _ in range(MAX_WAITING_OF_ONE):
        take(Origin(BY_PASSWORD, "one"))
    with pytest.raises(Busy):
        take(Origin(BY_PASSWORD, "one"))
    for number in range(MAX_WAITING - MAX_WAITING_OF_ONE):
        take(Origin(CODE, f"other {number}"))
    with pytest.raises(Busy):
        take(Origin(BY_PASSWORD, "somebody else"))
    take(Origin(PASSWORD_OF_KNOWN, "the owner"))
    for place in places:
        place.__exit__(None, None, None)
    assert not hashing._waiting
