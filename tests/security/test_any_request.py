"""Random requests to every route, in three roles: there is always a response and never a server error."""

import warnings
from typing import Any

import pytest
from hypothesis import HealthCheck, given, settings

from server.store import attempts
from server.web.csrf import FORM_FIELD
from tests.support.faults.invariants import Holdings
from tests.support.parameters import mostly_slow

WORDS = {"type": "string"}
FIELDS = (
    "step", "visit", "language", "code", "name", "password", "next", "blind", "text", "note", "reason", "minutes",
    "exclusion", "kind", "box_0", "satisfied", "simulated", "PROLIFIC_PID", "grid", "version", "table", "contains",
    "column", "sort", "operation", "revision", "template", "number", "condition", "what", "consent_text",
)  # fmt: skip
QUIET = {"deadline": None, "suppress_health_check": list(HealthCheck), "database": None, "derandomize": True}


def schema_of(server: Any) -> dict[str, Any]:
    """What FastAPI knows of the routes, with the forms that it does not know, and names that exist."""
    schema: dict[str, Any] = server.app.openapi()
    form = {"type": "object", "properties": dict.fromkeys(FIELDS, WORDS), "additionalProperties": True}
    known = {
        "name": ["short", "other"], "person": [server.person], "episode": [server.episode], "account": ["watch"],
        "kitchen": ["nook"], "draft": ["1"], "number": ["1"], "condition": ["tom"], "language": ["en"],
        "position": ["1"], "what": ["now"], "section": ["title"],
        "action": ["pause", "resume", "end", "message", "extend", "exclude", "restore", "release", "removed"],
    }  # fmt: skip
    for operations in schema["paths"].values():
        for method, operation in operations.items():
            for parameter in operation.get("parameters", ()):
                if parameter["in"] == "path":
                    parameter["schema"] = {"anyOf": [{"enum": known[parameter["name"]]}, WORDS]}
            if method == "post":
                operation["requestBody"] = {"content": {"application/x-www-form-urlencoded": {"schema": form}}}
    return schema


def answered(case: Any, server: Any, role: str) -> None:
    if role == "own" and server.request("GET /admin", role).status_code != 200:
        server.database.write_now(attempts.forget, role)  # what was thrown at this account locks it, as it should
        server.sign_in(role)
    if isinstance(case.body, dict):
        case.body[FORM_FIELD] = server.form_token(role, case.path.startswith("/admin"))
    headers = {"origin": server.live.url} | ({"cookie": server.cookies[role]} if server.cookies[role] else {})
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # of the client, about what it was made to send
        response = case.call(base_url=server.live.url, headers=headers)
    assert response.status_code < 500 or response.status_code == 503, f"{role}: {case.as_curl_command()}"


def throw(server: Any, role: str, most: int) -> int:
    """So many requests at every route; how many routes there were."""
    import schemathesis  # takes a second, in every worker that collects this file

    operations = [found.ok() for found in schemathesis.openapi.from_dict(schema_of(server)).get_all_operations()]
    for operation in operations:

        @settings(max_examples=most, **QUIET)
        @given(case=operation.as_strategy())
        def one(case: Any) -> None:
            answered(case, server, role)

        one()
    return len(operations)


@pytest.mark.parametrize("role", mostly_slow(["anonymous", "participant", "own"]))
def test_any_request_is_answered(server: Any, role: str) -> None:
    assert throw(server, role, most=1) >= 30


@pytest.mark.slow
@pytest.mark.timeout(1200)
@pytest.mark.parametrize("role", mostly_slow(["anonymous", "participant", "own"]))
def test_thousands_of_requests_are_answered(server: Any, role: str) -> None:
    assert throw(server, role, most=100) >= 30


def test_many_refused_requests_leave_nothing_behind(server: Any) -> None:
    import os

    def send(times: int) -> None:
        for _ in range(times):
            server.request("GET /admin/s/{name}/games", "anonymous")
            server.request("POST /s/{name}/now", "anonymous")

    send(20)
    before = Holdings.of(os.getpid())
    send(40)
    after = Holdings.of(os.getpid())
    assert after.descriptors <= before.descriptors + 2
