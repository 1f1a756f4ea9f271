"""Read submitted forms within limits. Their content is not trusted."""

import asyncio
import math
from collections.abc import Callable, Mapping
from urllib.parse import parse_qs

import msgspec
from fastapi import HTTPException, Request
from starlette.requests import ClientDisconnect

from server.study.answer_checks import CONTROL
from server.web.auth import session_of
from server.web.csrf import FORM_FIELD, NOBODY, CsrfProtection

MAX_FORM_BYTES = 128 * 1024
FORM_TIMEOUT_S = 30.0
MAX_FIELDS = 300

Form = Mapping[str, list[str]]


class FormExpired(HTTPException):
    """A page of this server sent the form, but it was made too long ago or for another session. `form`: its fields.
    `only_old`: it was made for this session."""

    def __init__(self, form: Form, only_old: bool = False) -> None:
        super().__init__(403, "The form has expired or is not from this server. Reload the page.")
        self.form = form
        self.only_old = only_old


async def read_form(
    request: Request,
    csrf: CsrfProtection,
    session: str | None = None,
    was_nobodys: Callable[[Form], bool] | None = None,
    controls: bool = False,
    largest: int = MAX_FORM_BYTES,
) -> Form:
    """Return all values by field name, with line ends as one newline and otherwise as they were written. Refuses (413,
    400, 403) what is too large, unreadable, or not from our own pages, and raises FormExpired (403). `session`: what
    the form was made for; None: the participant's. `was_nobodys`: whether the form may have been made before there was
    a session. `controls`: the caller deals with control characters itself. `largest`: how many bytes it may have."""
    if not csrf.is_own_origin(request):
        raise HTTPException(
            403, "The form was not sent by a page of this server. Open the page again and send it from there."
        )
    body = await body_of(request, largest)
    # Not `Request.form()`: Starlette needs python-multipart even for this encoding, does not limit the time that a form
    # takes, and accepts bytes that are not UTF-8.
    form = _json_fields(body) if _is_json(request) else _form_fields(body)
    found = {name: [_newlines(value) for value in values] for name, values in form.items()}
    sessions = [session_of(request) if session is None else session]
    if was_nobodys is not None and was_nobodys(form):
        sessions.append(NOBODY)
    token = first(form, FORM_FIELD)
    if not any(csrf.is_own_form(token, one) for one in sessions):
        raise FormExpired(found, csrf.is_own_form(token, sessions[0], max_age_s=math.inf))
    for name, values in found.items() if not controls else ():
        if any(CONTROL.search(value) for value in values):
            raise HTTPException(
                400, f"The field {name!r} contains a control character. Delete it and send the form again."
            )
    return found


def _is_json(request: Request) -> bool:
    return request.headers.get("content-type", "").partition(";")[0].strip().lower() == "application/json"


def _form_fields(body: bytes) -> dict[str, list[str]]:
    try:
        return parse_qs(body.decode("utf-8"), keep_blank_values=True, max_num_fields=MAX_FIELDS, errors="strict")
    except ValueError:  # also UnicodeDecodeError
        raise HTTPException(400, "The form body is not valid UTF-8. Reload the page and send the form again.") from None


def _json_fields(body: bytes) -> dict[str, list[str]]:
    """Return the fields of an object: texts, numbers, true (a ticked box), lists, and objects, whose fields get its
    name and a dot before theirs. What is null or false was not filled in."""
    try:
        given = msgspec.json.decode(body)
    except (msgspec.DecodeError, UnicodeDecodeError, RecursionError):
        raise HTTPException(
            400, "The body is not JSON in UTF-8. Send one object with the fields of the form."
        ) from None
    if not isinstance(given, dict):
        raise HTTPException(400, "The body is not a JSON object. Send one object with the fields of the form.")
    fields: dict[str, list[str]] = {}
    for name, value in given.items():
        inner = {f"{name}.{key}": one for key, one in value.items()} if isinstance(value, dict) else {name: value}
        for key, one in inner.items():
            values = one if isinstance(one, list) else [one]
            texts = [_text(key, each) for each in values if each is not None and each is not False]
            if texts:
                fields[key] = texts
    if sum(map(len, fields.values())) > MAX_FIELDS:
        raise HTTPException(400, f"The body has more than {MAX_FIELDS} fields. Send only those of the form.")
    return fields


def _text(name: str, value: object) -> str:
    if value is True:
        return "yes"
    if isinstance(value, float):
        return str(int(value)) if value.is_integer() else repr(value)
    if not isinstance(value, str | int):
        raise HTTPException(400, f"The field {name!r} is neither text, a number nor true. Send one of these.")
    return str(value)


async def body_of(request: Request, largest: int, what: str = "form") -> bytes:
    """Return the body of a request. Answers 413 if it is too large, 408 if it takes too long, and 400 if the browser
    left before it had sent everything, which is not a failure of the server."""
    body = bytearray()
    try:
        async with asyncio.timeout(FORM_TIMEOUT_S):
            async for chunk in request.stream():
                body += chunk
                if len(body) > largest:
                    raise HTTPException(413, f"This {what} is too large. Send at most {largest:,} bytes.")
    except TimeoutError:
        raise HTTPException(
            408, f"This {what} did not arrive within {FORM_TIMEOUT_S:g} s. Send it again.", {"Connection": "close"}
        ) from None
    except ClientDisconnect:
        raise HTTPException(400, f"This {what} did not arrive as a whole. Send it again.") from None
    return bytes(body)


def first(form: Form, name: str) -> str:
    """Return the field's first value, empty where there is none."""
    return form.get(name, [""])[0]


def whole_number(form: Form, name: str) -> int:
    """Return the field as a number from 0 on. Answers 400 for anything else."""
    text = first(form, name)
    if not (text.isascii() and text.isdigit() and len(text) < 10):
        raise HTTPException(400, f"The form has no valid {name}. Reload the page.")
    return int(text)


def _newlines(value: str) -> str:
    return value.replace("\r\n", "\n").replace("\r", "\n")
