"""Requests of unknown people, of other sites and broken ones are refused with a page, and change nothing."""

import threading
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from socket import SHUT_RDWR

import pytest
from uvicorn.protocols.websockets.websockets_sansio_impl import WebSocketsSansIOProtocol
from websockets.exceptions import ConnectionClosed, InvalidStatus
from websockets.sync.client import connect

from server.store.database import Database
from server.web.auth import token_for
from server.web.csrf import FORM_S, CsrfProtection
from server.web.participant.study_pages import MAX_ECHOES
from server.web.security_headers import policy
from tests.support.page_site import EVERYTHING, SMALL_STUDY, PageSite, Visitor


@pytest.fixture(scope="module")
def site(tmp_path_factory: pytest.TempPathFactory) -> Iterator[PageSite]:
    with PageSite(tmp_path_factory.mktemp("safety"), SMALL_STUDY) as running:
        yield running


def test_every_answer_carries_the_security_headers(site: PageSite) -> None:
    for path in ("/", "/s/small", "/nowhere", "/static/css/pages.css"):
        headers = Visitor(site).get(path).headers
        policy = headers["content-security-policy"]
        assert "default-src 'none'" in policy
        assert "script-src 'self';" in policy
        assert "unsafe" not in policy
        assert "frame-ancestors 'none'" in policy
        assert headers["x-content-type-options"] == "nosniff"
        assert headers["referrer-policy"] == "same-origin"


@pytest.mark.parametrize(
    "value",
    [
        "https://evil.test * ; script-src *",
        "https://evil.test;",
        "https://evil.test/path",
        "evil.test",
        "javascript:alert(1)",
        "https://[x",
        "https://a\nb",
        "*",
    ],
)
def test_a_policy_takes_nothing_but_plain_origins(value: str) -> None:
    for more in ({"form_to": value}, {"framed_by": value}):
        with pytest.raises(ValueError, match="plain origins only"):
            policy("lab.example.org", True, **more)
    assert ";x" not in policy(f"{value};x", True)["Content-Security-Policy"]


def test_a_policy_takes_the_origins_of_recruiters() -> None:
    text = policy("lab.example.org:8443", True, "https://www.mturk.com", "https://*.mturk.com")
    assert "connect-src 'self' wss://lab.example.org:8443;" in text["Content-Security-Policy"]
    assert "form-action 'self' https://www.mturk.com;" in text["Content-Security-Policy"]
    assert text["Content-Security-Policy"].endswith("frame-ancestors https://*.mturk.com")


def test_pages_have_no_inline_code_and_load_nothing_from_elsewhere(site: PageSite) -> None:
    visitor = Visitor(site)
    visitor.consent("small")
    for path in ("/", "/s/small/now", "/s/small/withdraw"):
        page = visitor.get(path).text
        assert " style=" not in page
        assert " onclick" not in page
        assert "<script>" not in page
        assert "http://" not in page.replace('xmlns="http://', "")
        assert "https://" not in page


def test_pages_are_never_cached(site: PageSite) -> None:
    visitor = Visitor(site)
    assert visitor.get("/s/small").headers["cache-control"] == "no-store"
    assert visitor.consent("small").headers["cache-control"] == "no-store"


@pytest.mark.parametrize("origin", ["https://evil.example", "http://127.0.0.1:1", "null"])
def test_form_from_another_site_is_refused(site: PageSite, origin: str) -> None:
    visitor = Visitor(site)
    visitor.consent("small")
    fields = visitor.fields() | {key: value for key, value in EVERYTHING.items() if isinstance(value, str)}
    before = site.everybody("small")[-1].position
    answer = visitor.client.post("/s/small/now", data=fields, headers={"origin": origin})
    assert answer.status_code == 403
    assert site.everybody("small")[-1].position == before


def test_form_without_our_mark_or_with_anothers_is_refused(site: PageSite) -> None:
    visitor, other = Visitor(site), Visitor(site)
    visitor.consent("small")
    other.consent("small")
    theirs = other.fields()["form_token"]
    mine = visitor.fields()
    for token in ("", "1.2", theirs, mine["form_token"][:-1], "9" * 20):
        assert visitor.send("/s/small/now", mine | {"form_token": token}).status_code == 403


def test_form_token_is_for_one_session_and_half_a_day() -> None:
    csrf = CsrfProtection(b"secret")
    token = csrf.form_token("mine", 1000)
    assert csrf.is_own_form(token, "mine", 1000 + FORM_S)
    assert not csrf.is_own_form(token, "mine", 1001 + FORM_S)
    assert csrf.is_own_form(token, "mine", 1000 - 3600), "the clock was set back by an hour"
    assert not csrf.is_own_form(token, "yours", 1000)
    assert not CsrfProtection(b"another").is_own_form(token, "mine", 1000)
    assert "mine" not in token, "the session is the participant's secret, and a page may be saved or shown around"


def test_cookies_of_running_studies_stay_valid() -> None:
    # Another derivation would turn everybody in a running study into somebody new.
    known = "3ced1091b77471f79cc6efd2908907da684840a228c5e240340f0314b2685dc2"
    assert token_for(b"secret", "small", "visit 1") == known


def test_cookie_travels_over_tls_only_where_the_address_is_https() -> None:
    assert CsrfProtection(b"s", "https://lab.example.org").secure
    assert not CsrfProtection(b"s", "http://127.0.0.1:8000").secure


@pytest.mark.parametrize(
    ("body", "status"),
    [
        (b"x" * 200_000, 413),
        (b"step=%ff%fe", 400),
        (b"\xff\xfe", 400),
        (b"&".join(b"a%d=1" % n for n in range(400)), 400),
        (b"", 403),
    ],
)
def test_broken_body_is_refused_and_nothing_breaks(site: PageSite, body: bytes, status: int) -> None:
    visitor = Visitor(site)
    visitor.consent("small")
    kind = {"content-type": "application/x-www-form-urlencoded"}
    answer = visitor.client.post("/s/small/now", content=body, headers=kind)
    assert answer.status_code == status
    assert visitor.get("/s/small/now").status_code == 200


@pytest.mark.parametrize("cookie", ["", "x", "a" * 64, "' or 1=1 --" + "x" * 30, "ü" * 30])
def test_an_invalid_cookie_leads_to_consent(site: PageSite, cookie: str) -> None:
    visitor = Visitor(site)
    page = visitor.client.get("/s/small/now", headers={"cookie": f"participant={cookie}".encode()})
    assert page.url.path == "/s/small"


@pytest.mark.parametrize("path", ["/nowhere", "/s/none", "/s/none/now/", "/s/small/nothing", "/s/../etc"])
def test_an_unknown_address_shows_a_page_with_a_link_home(site: PageSite, path: str) -> None:
    page = Visitor(site).get(path)
    assert page.status_code == 404
    assert "Page not found" in page.text
    assert 'href="/"' in page.text


def test_program_gets_its_error_as_json(site: PageSite) -> None:
    answer = Visitor(site, {"accept": "application/json"}).get("/nowhere")
    assert (answer.status_code, answer.json()) == (404, {"detail": "Not Found"})


def test_an_unavailable_database_shows_an_error_page(tmp_path: Path) -> None:
    with PageSite(tmp_path, SMALL_STUDY) as site:
        visitor = Visitor(site)
        visitor.consent("small")
        away = Database("postgresql://nobody@127.0.0.1:1/none", read_only=True)
        site.use(replace(site.services, web=replace(site.services.web, database=away)))
        page = visitor.get("/s/small/now")
        away.close()
        assert page.status_code == 503
        assert "A short interruption" in page.text


def test_an_internal_error_reveals_no_internal_details(tmp_path: Path) -> None:
    with PageSite(tmp_path, SMALL_STUDY) as site:
        visitor = Visitor(site)
        site.app.add_api_route("/broken", lambda: 1 / 0)
        page = visitor.get("/broken")
        assert page.status_code == 500
        assert "Something went wrong on our side" in page.text
        assert "ZeroDivision" not in page.text
        assert "default-src 'none'" in page.headers["content-security-policy"]


def test_entry_check_echoes_over_a_websocket_a_few_times(site: PageSite) -> None:
    url = site.url.replace("http", "ws") + "/s/small/check"
    with connect(url) as socket:
        for number in range(7):
            socket.send(str(number))
            assert socket.recv(timeout=5) == str(number)
    with connect(url) as socket:
        for _ in range(MAX_ECHOES):
            socket.send("x" * 100)
            assert socket.recv(timeout=5) == "x" * 16
        with pytest.raises(ConnectionClosed):
            socket.recv(timeout=5)
        assert socket.protocol.close_code == 1000
    with connect(url) as socket:
        socket.send(b"binary")
        with pytest.raises(ConnectionClosed):
            socket.recv(timeout=5)
        assert socket.protocol.close_code == 1003


def test_a_page_that_is_closed_during_the_entry_check_is_not_a_server_error(
    site: PageSite, monkeypatch: pytest.MonkeyPatch
) -> None:
    errors: list[object] = []
    over = threading.Event()
    check = WebSocketsSansIOProtocol.run_asgi

    async def watched(protocol: WebSocketsSansIOProtocol) -> None:
        monkeypatch.setattr(protocol.logger, "exception", lambda *words: errors.append(words))
        await check(protocol)
        over.set()

    monkeypatch.setattr(WebSocketsSansIOProtocol, "run_asgi", watched)
    with connect(site.url.replace("http", "ws") + "/s/small/check") as socket:
        socket.send("0")
        assert socket.recv(timeout=5) == "0"
        socket.socket.shutdown(SHUT_RDWR)
    assert over.wait(10)
    assert errors == []


def test_entry_check_refuses_other_sites_and_other_studies(site: PageSite) -> None:
    url = site.url.replace("http", "ws")
    with pytest.raises(InvalidStatus):
        connect(f"{url}/s/small/check", origin="https://evil.example")  # type: ignore[arg-type]
    with pytest.raises(InvalidStatus):
        connect(f"{url}/s/none/check")
