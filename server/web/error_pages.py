"""Error pages, in the usual layout and the reader's language, without internal details."""

import logging
from collections.abc import Mapping
from dataclasses import replace

from fastapi import FastAPI, Request, Response
from fastapi.exceptions import RequestValidationError
from fastapi.responses import JSONResponse
from starlette.exceptions import HTTPException

from server.store.database import DatabaseDown
from server.study.definition import Study
from server.web.admin.rendering import researchers_error
from server.web.dependencies import Web, known_study, page, web_of
from server.web.security_headers import security_headers

_KNOWN = (400, 403, 404, 409, 413, 429, 500, 503)
log = logging.getLogger(__name__)


def install_error_pages(app: FastAPI) -> None:
    """Turn errors into pages for browsers, and into a line of JSON for programs."""

    @app.exception_handler(HTTPException)
    async def refused(request: Request, error: HTTPException) -> Response:
        return error_page(request, error.status_code, str(error.detail), error.headers)

    @app.exception_handler(RequestValidationError)
    async def not_understood(request: Request, _error: RequestValidationError) -> Response:
        return error_page(request, 400, "The address or the form is not valid. Reload the page.")

    @app.exception_handler(DatabaseDown)
    async def no_database(request: Request, _error: DatabaseDown) -> Response:
        return error_page(
            request, 503, "The database cannot be reached. Try again in a few seconds.", {"Retry-After": "5"}
        )

    @app.exception_handler(Exception)
    async def broken(request: Request, error: Exception) -> Response:
        log.error("the page %s failed", request.url.path, exc_info=error)
        # The framework makes this answer outside of all middleware.
        headers = security_headers(request.headers.get("host", ""), web_of(request).csrf.secure)
        return error_page(
            request,
            500,
            "Something went wrong on our side. Try again; if it happens again, tell the person who runs the server.",
            headers,
        )


def error_page(request: Request, status: int, reason: str, headers: Mapping[str, str] | None = None) -> Response:
    """Return the response to a failed request. `reason` is for programs and researchers; participants see the page's
    own text."""
    if "text/html" not in request.headers.get("accept", ""):
        return JSONResponse({"detail": reason}, status, dict(headers or {}))
    if f"{request.url.path}/".startswith("/admin/"):
        made: Response = researchers_error(request, status, reason)
    else:
        made = _participants_error(request, status)
    for name, value in (headers or {}).items():
        made.headers[name] = value
    return made


def _participants_error(request: Request, status: int) -> Response:
    web = web_of(request)
    # A path below /s/name leads back into the study; only a name that exists is put into the page.
    pieces = request.url.path.split("/")
    study = _known(web, pieces[2]) if len(pieces) > 2 and pieces[1] == "s" else None
    kind = str(status if status in _KNOWN else 500 if status >= 500 else 400)
    path = f"{web.csrf.root}/s/{study.name}" if study else ""
    is_entry = study is not None and len(pieces) == 3
    link = dict(request.query_params) if is_entry else getattr(request.state, "link", None)
    made = replace(page(request, web, study), link=link)
    return made.render("participant/error.html", status, kind=kind, study=None, path=path, is_entry=is_entry)


def _known(web: Web, name: str) -> Study | None:
    """Return the study, also if it takes nobody new: its participants continue."""
    try:
        return known_study(name, web).study
    except HTTPException:
        return None
