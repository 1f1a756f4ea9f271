"""Routes of the page that shows recorded games from a researcher's file. Nothing of the file is stored."""

import re
from typing import Final

from fastapi import APIRouter, HTTPException, Request, Response

from server.monitoring.opened_games import MAX_BYTES, UnreadableGamesError, opened
from server.study.locale import locale
from server.web.admin.rendering import AdminPage
from server.web.admin.researcher_auth import WatchDep, form_session
from server.web.dependencies import WebDep
from server.web.forms import body_of

router = APIRouter(prefix="/admin/recordings")
TOKEN_HEADER: Final = "x-form-token"  # noqa: S105 - the body is the file
_NAME: Final = re.compile(r"[^/\\\x00-\x1f]{1,200}\.(jsonl|json)(\.gz)?")
_open: set[str] = set()  # whose file is being read


@router.get("")
async def page(request: Request, admin: WatchDep) -> Response:
    """Choose or drop a file."""
    texts = locale("en").section("game")
    return AdminPage(request, admin).render("recordings.html", tab="recordings", largest=MAX_BYTES, texts=texts)


@router.post("/records.json")
async def records(request: Request, admin: WatchDep, web: WebDep, name: str = "") -> Response:
    """Return the episodes of the file in the body, simulated again. Answers 422 with the reason if that fails."""
    if not web.csrf.is_own_origin(request):
        raise HTTPException(
            403, "The file was not sent by a page of this server. Open the page again and send it from there."
        )
    if not web.csrf.is_own_form(request.headers.get(TOKEN_HEADER, ""), form_session(request)):
        raise HTTPException(403, "This page has expired. Reload it and open the file again.")
    if not _NAME.fullmatch(name):
        raise HTTPException(422, "A file of recorded games ends in .jsonl or .json, or in one of these and .gz.")
    if admin.name in _open:
        raise HTTPException(409, "Another file of yours is still being read. Wait a moment and try again.")
    _open.add(admin.name)
    try:
        found = await opened(await body_of(request, MAX_BYTES, "file"), name)
    except UnreadableGamesError as error:
        raise HTTPException(422, str(error)) from None
    finally:
        _open.discard(admin.name)
    return Response(found, media_type="application/json", headers={"Cache-Control": "no-store"})
