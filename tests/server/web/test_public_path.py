"""Behind a path of the public address: requests lose it, redirects and cookies get it, pages are written with it."""

import re
from pathlib import Path
from typing import Any

import httpx
import pytest
from fastapi import FastAPI, Response
from fastapi.responses import RedirectResponse
from pydantic import ValidationError
from starlette.types import Receive, Scope, Send

from server.settings import Settings
from server.web.csrf import CsrfProtection
from server.web.public_path import PublicPath
from tests.support.real_server import ROOT

SECRET = "a secret of the tests, long enough"


def small_app(root: str) -> FastAPI:
    app = FastAPI()

    @app.get("/")
    def start() -> str:
        return "start"

    @app.get("/s/{name}")
    def study(name: str) -> Response:
        response = Response(name)
        response.set_cookie("participant", "token", path=f"/s/{name}")
        response.set_cookie("other", "token; path=/no", path="/admin")
        return response

    @app.get("/go")
    def go(to: str) -> Response:
        return RedirectResponse(to)

    app.add_middleware(PublicPath, root=root)
    return app


async def asked(root: str, path: str, **query: str) -> httpx.Response:
    transport = httpx.ASGITransport(small_app(root))
    async with httpx.AsyncClient(transport=transport, base_url="http://lab.example.org") as client:
        return await client.get(path, params=query or None)


@pytest.mark.parametrize("path", ["/kitchen/s/a%20b", "/s/a%20b"], ids=["proxy keeps the path", "proxy takes it off"])
async def test_a_request_is_found_with_and_without_the_path(path: str) -> None:
    assert (await asked("/kitchen", path)).text == "a b"


@pytest.mark.parametrize("path", ["/kitchen", "/kitchen/", "/"])
async def test_the_first_page_has_three_spellings(path: str) -> None:
    assert (await asked("/kitchen", path)).json() == "start"


async def test_a_longer_name_is_another_path() -> None:
    assert (await asked("/kitchen", "/kitchens/s/a")).status_code == 404


async def test_sockets_lose_the_path_too() -> None:
    seen: list[Scope] = []

    async def inside(scope: Scope, _receive: Receive, _send: Send) -> None:
        seen.append(scope)

    nothing: Any = None
    scope = {"type": "websocket", "path": "/kitchen/s/ring/socket", "raw_path": b"/kitchen/s/ring/socket"}
    await PublicPath(inside, "/kitchen")(scope, nothing, nothing)
    assert (seen[0]["path"], seen[0]["raw_path"]) == ("/s/ring/socket", b"/s/ring/socket")


@pytest.mark.parametrize(
    ("to", "seen"),
    [
        ("/admin?outcome=done", "/kitchen/admin?outcome=done"),
        ("https://app.prolific.com/x", "https://app.prolific.com/x"),
    ],
)
async def test_redirects_to_our_pages_get_the_path_and_others_do_not(to: str, seen: str) -> None:
    assert (await asked("/kitchen", "/go", to=to)).headers["location"] == seen
    assert (await asked("", "/go", to=to)).headers["location"] == to


async def test_cookies_are_sent_below_the_path_only() -> None:
    first, second = (await asked("/kitchen", "/s/ring")).headers.get_list("set-cookie")
    assert "Path=/kitchen/s/ring" in first
    assert second.startswith('other="token\\073 path=/no"')
    assert second.endswith("Path=/kitchen/admin; SameSite=lax")


@pytest.mark.parametrize(
    ("address", "root"),
    [
        ("", ""),
        ("https://lab.example.org", ""),
        ("https://lab.example.org/", ""),
        ("https://lab.example.org/kitchen/", "/kitchen"),
        ("https://lab.example.org:8443/teams/kitchen_2", "/teams/kitchen_2"),
    ],
)
def test_the_path_comes_from_the_public_address(tmp_path: Path, address: str, root: str) -> None:
    settings = Settings(public_url=address, data=tmp_path, secret=SECRET, _env_file=None)
    assert CsrfProtection(b"secret", settings.public_url).root == root


@pytest.mark.parametrize("path", ["/a//b", "/../a", "/a?b", "/a;b", "/ä", "/a b", "/a/%2e%2e"])
def test_a_path_that_needs_escapes_is_refused_with_the_remedy(tmp_path: Path, path: str) -> None:
    with pytest.raises(ValidationError, match="only letters, digits, - and _ in a path"):
        Settings(public_url=f"https://lab.example.org{path}", data=tmp_path, secret=SECRET, _env_file=None)


def sources(folder: str, endings: tuple[str, ...]) -> list[tuple[Path, str]]:
    files = [file for file in (ROOT / folder).rglob("*") if file.suffix in endings and "vendor" not in file.parts]
    assert files
    return [(file, file.read_text(encoding="utf-8")) for file in files]


def found(texts: list[tuple[Path, str]], pattern: str) -> list[str]:
    return [f"{file.name}: {match[0]}" for file, text in texts for match in re.finditer(pattern, text)]


def test_no_page_names_an_address_without_the_path() -> None:
    templates: Any = sources("templates", (".html",))
    assert found(templates, r'(?:href|src|action|data-[a-z-]+)="/[^"]*"') == []
    assert found(templates, r'(?<!root ~ )(?<!root ~\n  )"/(?:admin|s|static|watch)/[^"]*"') == []


def test_no_script_and_no_style_names_an_address_without_the_path() -> None:
    assert found(sources("static/js", (".js",)), r"""['"`]/(?:admin|s|static|watch)\b[^'"`]*""") == []
    assert found(sources("static/css", (".css",)), r"url\(['\"]?/") == []
