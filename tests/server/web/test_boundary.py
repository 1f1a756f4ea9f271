"""Rules for every response: HEAD works where GET does, redirects lead to our own pages only, nothing is cached."""

import re
from collections.abc import Iterator

import httpx
import pytest

from tests.support.live_server import LiveServer

FOREIGN = "evil.example"


@pytest.fixture(scope="module")
def live(tmp_path_factory: pytest.TempPathFactory) -> Iterator[LiveServer]:
    with LiveServer(tmp_path_factory.mktemp("boundary")) as running:
        yield running


@pytest.mark.parametrize(
    "path",
    ["/", "/s/short", "/s/short/now", "/s/none", "/watch", "/admin/login", "/health/live", "/health/ready", "/metrics",
     "/static/css/pages.css"],
)  # fmt: skip
def test_head_is_get_without_the_body(live: LiveServer, path: str) -> None:
    got, head = httpx.get(live.url + path), httpx.head(live.url + path)
    assert head.status_code == got.status_code != 405
    assert head.content == b""

    def told(answer: httpx.Response) -> dict[str, str]:
        return {name: value for name, value in answer.headers.items() if name not in ("date", "content-length")}

    assert told(head) == told(got)


def test_head_of_what_takes_forms_only_is_refused(live: LiveServer) -> None:
    assert httpx.head(f"{live.url}/s/short/consent").status_code == 405


@pytest.mark.parametrize("path", ["/admin/login/", "/s/short/", "/health/live/?x=1", "/watch/"])
def test_a_redirect_does_not_contain_the_requested_host(live: LiveServer, path: str) -> None:
    answer = httpx.get(live.url + path, headers={"host": FOREIGN, "x-forwarded-host": FOREIGN})
    assert answer.status_code in (307, 308)
    assert answer.headers["location"] == path.replace("/?", "?").removesuffix("/")
    assert httpx.get(live.url + path, follow_redirects=True).status_code == 200


@pytest.mark.parametrize(
    "path", [f"//{FOREIGN}/", f"//{FOREIGN}/admin/login/", f"/\\{FOREIGN}/", f"//{FOREIGN}/..//static"]
)
def test_no_redirect_leads_elsewhere(live: LiveServer, path: str) -> None:
    with httpx.Client() as client:
        request = client.build_request("GET", live.url)
        request.url = request.url.copy_with(raw_path=path.encode())
        answer = client.send(request)
    assert not answer.headers.get("location", "/").startswith(("//", "/\\", "http"))


@pytest.mark.parametrize("host", ["[", "a b", "evil.example/x", "x:y:z", "ü", ""])
def test_an_invalid_host_header_causes_no_error(live: LiveServer, host: str) -> None:
    answer = httpx.get(f"{live.url}/s/short/nothing/", headers={"host": host.encode("latin-1"), "accept": "text/html"})
    assert answer.status_code in (400, 404)


def test_no_response_but_static_files_is_cached(live: LiveServer, readable: list[str]) -> None:
    for path in readable:
        assert httpx.get(live.url + path).headers.get("cache-control") == "no-store", path
    assert "no-store" not in httpx.get(f"{live.url}/static/css/pages.css").headers.get("cache-control", "")


@pytest.fixture
def readable(live: LiveServer) -> list[str]:
    """Every route that answers to GET, with names that may not exist: an error is not kept either."""
    paths = [path for path, operations in live.app.openapi()["paths"].items() if "get" in operations]
    assert any("latency.json" in path for path in paths)
    return [re.sub(r"\{\w+\}", "short", path) for path in paths]
