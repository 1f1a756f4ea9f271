"""Routes of a study's report: make it, follow the progress, open it, download it, for those who may export data."""

import asyncio
import base64
import hashlib
import io
import zipfile
from datetime import datetime
from typing import Any, Final

from fastapi import APIRouter, HTTPException, Response
from fastapi.responses import HTMLResponse

from server.monitoring.report_making import PAGE, missing_command
from server.settings import ROOT
from server.store import audit, study_reports
from server.store.admins import AdminSession
from server.web.admin.rendering import study_at
from server.web.admin.researcher_auth import ActDep, AdminFormDep
from server.web.dependencies import Web, WebDep
from server.web.services import ServicesDep

router = APIRouter(prefix="/admin/s/{name}")
_NONE_YET: Final = "there is no report of this study: make it first"


@router.get("/report.json")
async def state(name: str, admin: ActDep, web: WebDep) -> dict[str, Any]:
    """Return the progress or outcome of the newest attempt, and which report is kept."""
    study_at(web, name)
    _check_sight(admin)
    return await _state(web, name)


@router.post("/report")
async def make(name: str, admin: ActDep, services: ServicesDep, form: AdminFormDep) -> dict[str, Any]:  # noqa: ARG001 - checks the form
    """Begin to make a report of the data as they are now."""
    study_at(services.web, name)
    _check_sight(admin)
    if command := missing_command():
        raise HTTPException(409, f"Reports need packages that are not installed here. Run `{command}`.")
    if not await services.reports.start(name, admin.name):
        raise HTTPException(503, "Another report is being made. Try again when it is ready.", {"Retry-After": "30"})
    return await _state(services.web, name)


@router.get("/report.html")
async def page(name: str, admin: ActDep, web: WebDep) -> Response:
    """Show the report. It may use only what the page contains, and runs isolated from our own pages (sandbox)."""
    archive = await _archive(web, name, admin)
    text = await asyncio.to_thread(_page_of, archive)
    return HTMLResponse(text, headers={"Content-Security-Policy": _policy(), "Cache-Control": "no-store"})


@router.post("/report.zip")
async def download(name: str, admin: ActDep, web: WebDep, form: AdminFormDep) -> Response:  # noqa: ARG001 - checks the form
    """Send the page, the table of results, the quality of each episode and the figures."""
    archive = await _archive(web, name, admin)
    await web.database.write(audit.add, admin.name, "download report", {"study": name})
    headers = {"Content-Disposition": f'attachment; filename="{name}-report.zip"', "Cache-Control": "no-store"}
    return Response(archive, media_type="application/zip", headers=headers)


def _check_sight(admin: AdminSession) -> None:
    if admin.blind:
        raise HTTPException(409, "A report shows the conditions. Turn blind mode off first.")


async def _archive(web: Web, name: str, admin: AdminSession) -> bytes:
    study_at(web, name)
    _check_sight(admin)
    found = await web.database.read(study_reports.archive_of, name)
    if found is None:
        raise HTTPException(404, _NONE_YET)
    return found


async def _state(web: Web, name: str) -> dict[str, Any]:
    newest, kept = await web.database.read(study_reports.newest, name)
    return {
        "stage": newest.stage if newest is not None and newest.is_running else "",
        "failure": newest.reason if newest is not None else "",
        "kept": None if kept is None else _kept(kept),
        "missing": missing_command(),
    }


def _kept(report: study_reports.StoredReport) -> dict[str, Any]:
    at: datetime = report.made_at or report.started_at
    return {
        "at": at.isoformat(),
        "by": report.started_by,
        "participants": report.participants,
        "simulated": report.simulated,
    }


def _page_of(archive: bytes) -> str:
    with zipfile.ZipFile(io.BytesIO(archive)) as files:
        return files.read(PAGE).decode("utf-8")


def _policy() -> str:
    """Return the page's content security policy. Styles are in the page and in its figures, so they cannot be listed;
    of scripts, only the report's own runs."""
    script = base64.b64encode(hashlib.sha256((ROOT / "analysis" / "report.js").read_bytes()).digest()).decode()
    return (
        f"default-src 'none'; script-src 'sha256-{script}'; style-src 'unsafe-inline'; img-src data:; "
        "base-uri 'none'; form-action 'none'; frame-ancestors 'none'; sandbox allow-scripts"
    )
