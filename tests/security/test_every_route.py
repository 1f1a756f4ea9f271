"""Every route and every socket of the application, tried in every role. A new one fails here until it is listed.

One test for each route goes through all roles: a test for each pair would only add 215 starts of a test.
"""

import re
from collections.abc import Iterator
from typing import Any

import pytest
from fastapi import FastAPI
from fastapi.routing import APIRoute, APIWebSocketRoute
from sqlalchemy import select
from websockets.exceptions import ConnectionClosed, InvalidStatus
from websockets.sync.client import connect

from server.play.close_codes import CloseCode
from server.store.tables import participants
from server.web.csrf import FORM_FIELD

ROLES = ("anonymous", "other", "participant", "watch", "act", "own")  # other: a participant of another study
RESEARCHERS = ROLES[3:]  # each may what those before it may

# Who has access: "all", "participant" (of this study; all others are led to its consent page), or a researcher's role.
ROUTES = {
    "GET /health/live": "all",
    "GET /health/ready": "all",
    "GET /protocol.json": "all",
    "GET /metrics": "all",  # in local mode only; see tests/server/web/test_health.py
    "GET /": "all",
    "GET /s/{name}": "all",
    "POST /s/{name}/arrivals": "all",
    "POST /s/{name}/consent": "all",
    "GET /s/{name}/declined": "all",
    "GET /s/{name}/unsuitable": "all",
    "GET /s/{name}/withdraw": "all",
    "POST /s/{name}/withdraw": "all",  # asks for the cookie or the code, and deletes nobody else
    "GET /s/{name}/new": "all",  # asks first; who takes part in this browser is forgotten by a form
    "POST /s/{name}/new": "all",
    "GET /s/{name}/now": "participant",
    "POST /s/{name}/now": "participant",
    "POST /s/{name}/language": "participant",
    "GET /watch": "all",  # agents among themselves: nobody's data
    "GET /watch/game": "all",
    "SOCKET /watch/socket": "all",
    "SOCKET /s/{name}/check": "all",
    "SOCKET /s/{study}/socket": "participant",
    "GET /admin/login": "all",
    "POST /admin/login": "all",
    "POST /admin/logout": "watch",
    "GET /admin": "watch",
    "POST /admin/blind": "act",
    "GET /admin/audit": "watch",
    "GET /admin/accounts": "own",
    "POST /admin/accounts/{account}/{action}": "own",
    "GET /admin/kitchens": "own",
    "GET /admin/kitchens/new": "own",
    "GET /admin/kitchen/{kitchen}": "own",
    "GET /admin/recordings": "watch",
    "POST /admin/recordings/records.json": "watch",
    "POST /admin/kitchens/check": "own",
    "POST /admin/kitchens/trial": "own",
    "POST /admin/kitchens/save": "own",
    "POST /admin/kitchen/{kitchen}/remove": "own",
    "GET /admin/study-keys/{section}": "own",
    "GET /admin/drafts": "own",
    "POST /admin/drafts": "own",
    "GET /admin/drafts/new": "own",
    "GET /admin/drafts/{draft}": "own",
    "GET /admin/drafts/{draft}/history": "own",
    "GET /admin/drafts/{draft}/history/{number}": "own",
    "POST /admin/drafts/{draft}/restore": "own",
    "POST /admin/drafts/{draft}/delete": "own",
    "POST /admin/drafts/{draft}/look": "own",
    "POST /admin/drafts/{draft}/markdown": "own",
    "POST /admin/drafts/{draft}/save": "own",
    "POST /admin/drafts/{draft}/aside": "own",
    "POST /admin/drafts/{draft}/open": "own",
    "POST /admin/drafts/{draft}/close": "own",
    "GET /admin/drafts/{draft}/preview": "own",
    "GET /admin/drafts/{draft}/preview/{condition}/{language}/{position}": "own",
    "GET /admin/drafts/{draft}/preview/{condition}/{language}/{position}/{what}": "own",
    "POST /admin/drafts/{draft}/preview/{condition}/{language}/{position}/{what}": "own",
    "GET /admin/drafts/{draft}/preview/{condition}/{language}/{position}/play": "own",
    "SOCKET /admin/drafts/{draft}/preview/{condition}/{language}/{position}/socket": "own",
    "GET /admin/drafts/{draft}/bots": "own",
    "POST /admin/drafts/{draft}/bots": "own",
    "GET /admin/s/{name}": "watch",
    "GET /admin/s/{name}/games": "watch",
    "GET /admin/s/{name}/data": "act",
    "POST /admin/s/{name}/data.csv": "act",
    "GET /admin/s/{name}/latency.json": "watch",
    "GET /admin/s/{name}/quality.json": "watch",
    "GET /admin/s/{name}/person/{person}": "watch",
    "GET /admin/s/{name}/consort.svg": "watch",
    "GET /admin/s/{name}/game/{episode}": "watch",
    "GET /admin/s/{name}/game/{episode}/record.json": "watch",
    "POST /admin/s/{name}/pause": "act",
    "POST /admin/s/{name}/resume": "act",
    "POST /admin/s/{name}/message": "act",
    "POST /admin/s/{name}/version": "act",
    "POST /admin/s/{name}/game/{episode}/{action}": "act",
    "POST /admin/s/{name}/person/{person}/{action}": "act",
    "POST /admin/s/{name}/find": "act",
    "POST /admin/s/{name}/export": "act",
    "GET /admin/s/{name}/report.json": "act",
    "POST /admin/s/{name}/report": "act",
    "GET /admin/s/{name}/report.html": "act",
    "POST /admin/s/{name}/report.zip": "act",
    "SOCKET /admin/s/{name}/live": "watch",
    "SOCKET /admin/s/{name}/game/{episode}/live": "watch",
    "MOUNT /static": "all",
}


def routes(app: FastAPI) -> Iterator[str]:
    """Every route, socket and mounted folder of the application."""

    def walk(nested: list[Any]) -> Iterator[str]:
        for route in nested:
            if isinstance(route, APIRoute):
                yield from (f"{method} {route.path}" for method in sorted(route.methods - {"HEAD"}))
            elif isinstance(route, APIWebSocketRoute):
                yield f"SOCKET {route.path}"
            elif hasattr(route, "original_router"):
                yield from walk(route.original_router.routes)
            else:
                yield f"MOUNT {route.path}"

    return walk(list(app.routes))


def test_every_route_of_the_application_is_listed(server: Any) -> None:
    assert set(routes(server.app)) == set(ROUTES)


def test_no_two_routes_have_one_address(server: Any) -> None:
    found = [re.sub(r"{\w+}", "{}", route) for route in routes(server.app)]
    assert len(found) == len(set(found))


def may(role: str, who: str) -> bool:
    """Whether a role may use a route for `who`."""
    if who in RESEARCHERS and role in RESEARCHERS:
        return RESEARCHERS.index(role) >= RESEARCHERS.index(who)
    return who in ("all", role)


@pytest.mark.parametrize("route", [one for one in ROUTES if one.startswith(("GET", "POST"))])
def test_a_role_gets_in_where_it_may_and_nowhere_else(server: Any, route: str) -> None:
    for role in ROLES:
        try_route(server, route, role)


def try_route(server: Any, route: str, role: str) -> None:
    who = ROUTES[route]
    if role in RESEARCHERS and server.request("GET /admin", role).status_code != 200:
        server.sign_in(role)  # a route before this one signed them out
    stood = server.database.read_now(lambda connection: connection.execute(select(participants)).all())
    answer = server.request(route, role)
    assert answer.status_code < 500, f"{role} at {route}: {answer.text}"
    if who == "participant" and role != "participant":
        led = (answer.status_code, answer.headers.get("location", "").partition("/now")[0])
        assert led == (303, "/s/short"), f"{role} at {route}"
        after = server.database.read_now(lambda connection: connection.execute(select(participants)).all())
        assert after == stood, f"{role} at {route}"
    elif not may(role, who):
        assert answer.status_code in (401, 403), f"{role} at {route}: {answer.status_code}"
        assert server.person not in answer.text, f"{role} at {route}"
    else:
        if (route, role) == ("POST /s/{name}/withdraw", "participant"):
            server.fill()  # they are gone, as they asked
        assert answer.status_code not in (401, 403) or route == "POST /admin/login", f"{role} at {route}: {answer.text}"


def test_a_participant_can_withdraw_only_themselves(server: Any) -> None:
    for role in ("anonymous", "other", "watch", "own"):
        server.request("POST /s/{name}/withdraw", role)
    query = select(participants.c.id).where(participants.c.id == server.person)
    assert server.database.read_now(lambda connection: connection.execute(query).scalar_one()) == server.person


@pytest.mark.parametrize("route", sorted(one for one in ROUTES if one.startswith("SOCKET")))
def test_a_socket_opens_for_its_role_only_and_for_no_foreign_page(server: Any, route: str) -> None:
    for role in ROLES:
        try_socket(server, route, role)


def try_socket(server: Any, route: str, role: str) -> None:
    place = {"draft": "1", "condition": "tom", "language": "en", "position": "1"}
    path = route.partition(" ")[2].format(name="short", study="short", episode=server.episode, **place)
    if role in RESEARCHERS and server.request("GET /admin", role).status_code != 200:
        server.sign_in(role)
    headers = {"Cookie": server.cookies[role]} if server.cookies[role] else {}
    url = server.live.url.replace("http", "ws") + path
    if "{draft}" in route:  # there is no game in this draft: the test of the builder plays one
        with pytest.raises(InvalidStatus, match=r"40[34]"):
            connect(url, additional_headers=headers, origin=server.live.url)  # type: ignore[arg-type]
    elif may(role, ROUTES[route]):
        with connect(url, additional_headers=headers, origin=server.live.url):  # type: ignore[arg-type]
            pass
    elif route.endswith(" /s/{study}/socket"):  # a page of ours learns why it gets nothing
        with connect(url, additional_headers=headers, origin=server.live.url) as socket:  # type: ignore[arg-type]
            with pytest.raises(ConnectionClosed) as closed:
                socket.recv(10)
            assert closed.value.rcvd is not None
            assert closed.value.rcvd.code == CloseCode.NO_GAME
    else:
        with pytest.raises(InvalidStatus, match="403"):
            connect(url, additional_headers=headers, origin=server.live.url)  # type: ignore[arg-type]
    for origin in ("https://evil.example", "null", server.live.url.replace("127.0.0.1", "localhost")):
        with pytest.raises(InvalidStatus, match=r"40[34]" if "{draft}" in route else "403"):
            connect(url, additional_headers=headers, origin=origin)  # type: ignore[arg-type]


def test_the_episodes_of_another_study_are_not_found_in_this_one(server: Any) -> None:
    server.sign_in("own")
    for path in (f"person/{server.person}", f"game/{server.episode}", f"game/{server.episode}/record.json"):
        with server.client(server.cookies["own"]) as client:
            assert client.get(f"/admin/s/short/{path}").status_code == 200
            assert client.get(f"/admin/s/other/{path}").status_code == 404


def test_no_route_looks_for_a_name_with_a_nul_character(server: Any) -> None:
    """PostgreSQL refuses such a text, which was an error of the server."""
    for route in (route for route in ROUTES if "{" in route):
        if server.request("GET /admin", "own").status_code != 200:
            server.sign_in("own")
        assert status_with_nul(server, *route.split(" ", 1)) == 404, route


def status_with_nul(server: Any, method: str, path: str) -> int:
    """The answer where the last name in the address has a NUL character."""
    *_, last = re.findall(r"\{\w+\}", path)
    path = re.sub(r"\{\w+\}", "short", path.replace(last, "a%00b"))
    if method == "SOCKET":
        url, cookie = server.live.url.replace("http", "ws") + path, {"Cookie": server.cookies["own"]}
        with pytest.raises(InvalidStatus) as refused:
            connect(url, additional_headers=cookie, origin=server.live.url)
        return refused.value.response.status_code
    with server.client(server.cookies["own"]) as client:
        fields = {FORM_FIELD: server.form_token("own", path.startswith("/admin"))}
        answer = client.get(path) if method == "GET" else client.post(path, data=fields)
    return int(answer.status_code)
