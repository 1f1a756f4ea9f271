"""Routes that check, save, open and close a study that is written in the dashboard. POST only."""

import asyncio
import json
import logging
from collections.abc import Mapping
from dataclasses import asdict, replace
from typing import Any, Final

from fastapi import APIRouter, HTTPException, Response
from fastapi.responses import JSONResponse
from sqlalchemy import Connection

from server.monitoring.commands import OpenVersion, PrepareVersion
from server.participation.draft_checks import draft_problems
from server.participation.own_kitchens import drawn_grids
from server.participation.study_changes import Versions
from server.participation.training_commands import own_names_of
from server.store import audit, interventions, study_drafts, study_openings
from server.store.study_drafts import MERGED, DraftText, StudyDraft
from server.study import drafting
from server.study.loader import PlacedProblem, StudyError, StudyFile
from server.study.yaml_edit import YamlEditError
from server.web.admin.actions import OPEN_TIMEOUT_S, VERSION_TIMEOUT_S
from server.web.admin.draft_pages import DraftDep, DraftFormDep, GridsDep
from server.web.admin.draft_saving import MergeConflict, base_of, save_merged
from server.web.admin.rendering import back_to
from server.web.admin.researcher_auth import AdminFormDep, OwnDep
from server.web.forms import first, whole_number
from server.web.services import Services, ServicesDep

log = logging.getLogger(__name__)
router = APIRouter(prefix="/admin/drafts/{draft}")
MAX_OPERATION: Final = 100_000
NOTES: Final = (study_drafts.EDITED, MERGED)


def _text(form: DraftFormDep) -> str:
    text = first(form, "text")
    if len(text) > drafting.MAX_CHARACTERS:
        raise HTTPException(
            413, f"This text has {len(text):,} characters; a draft has at most {drafting.MAX_CHARACTERS:,}. Shorten it."
        )
    return text


@router.post("/look")
async def check_text(
    admin: OwnDep,  # noqa: ARG001 - checks who asks
    services: ServicesDep,
    form: DraftFormDep,
    grids: GridsDep,
) -> Response:
    """Apply a change from the form to a text, and say what is in the text and what is wrong with it. Stores nothing."""
    text, operation = _text(form), first(form, "operation")
    if len(operation) > MAX_OPERATION:
        raise HTTPException(413, f"This change has more than {MAX_OPERATION:,} characters. Make it in the YAML.")
    refused = ""
    if operation:
        try:
            text = await asyncio.to_thread(drafting.changed, text, json.loads(operation))
        except (ValueError, RecursionError) as error:  # also YamlEditError, StudyError and JSONDecodeError
            refused = (
                str(error) if isinstance(error, YamlEditError | StudyError) else "Invalid change. Reload the page."
            )
    view = await asyncio.to_thread(_viewed, text, services, grids)
    return JSONResponse(view | {"text": text, "refused": refused})


def _viewed(text: str, services: Services, grids: Mapping[str, str]) -> dict[str, Any]:
    view = drafting.view(text)
    problems, drawn = list(view.problems), dict(grids)
    if view.file is not None:
        file = services.versions.as_opened(view.file, grids)
        problems, drawn = _problems(file, services.versions), drawn | drawn_grids(file.study)
    own = own_names_of(drawn, services.settings.own_models)
    return {"values": view.values, "problems": [_problem_json(one) for one in problems], "own": own}


def _problems(file: StudyFile, versions: Versions, loads: bool = False) -> list[PlacedProblem]:
    """Return everything that keeps a draft from being opened, and warnings."""
    found = draft_problems(file, versions.of_files(), loads)
    return found + versions.clash(file) if all(problem.warning for problem in found) else found


def _problem_json(problem: PlacedProblem) -> dict[str, Any]:
    told = {"line": problem.line, "path": problem.path, "text": problem.text, "warning": problem.warning}
    return told if problem.fix is None else told | {"fix": asdict(problem.fix)}


@router.post("/markdown")
async def markdown(admin: OwnDep, services: ServicesDep, form: DraftFormDep) -> Response:  # noqa: ARG001
    """Render a Markdown text as participants see it; HTML in it is escaped."""
    render = services.web.templates.filters["markdown"]
    return JSONResponse({"html": str(await asyncio.to_thread(render, _text(form)))})


@router.post("/save")
async def save(admin: OwnDep, services: ServicesDep, draft: DraftDep, form: DraftFormDep) -> Response:
    """Save a text on top of the revision that it is based on. Somebody else has saved since: the answer has the text
    with the changes of both; 409 where they contradict, and both texts are kept."""
    source, revision, database = _text(form), whole_number(form, "revision"), services.web.database
    note = first(form, "note") or NOTES[0]
    if note not in NOTES:
        raise HTTPException(400, "This text was saved with an unknown note. Reload the page.")
    name = await asyncio.to_thread(drafting.named, source) or draft.name
    base, before = (first(form, field) if field in form else None for field in ("base", "before"))
    base = await base_of(database, draft.id, base, before)
    saved = await save_merged(database, draft.id, DraftText(admin.name, source, name, revision, note, base))
    if saved is None:
        raise HTTPException(404, "This draft does not exist. Open it from the list of drafts.")
    if isinstance(saved, MergeConflict):
        newest = saved.newest
        theirs = {"revision": newest.revision, "text": newest.source, "author": newest.changed_by}
        parts = [part if isinstance(part, str) else asdict(part) for part in saved.parts]
        return JSONResponse(theirs | {"at": newest.changed_at.isoformat(), "parts": parts}, 409)
    return JSONResponse({"revision": saved.revision, "author": saved.changed_by, "text": saved.source})


@router.post("/aside")
async def set_aside(admin: OwnDep, services: ServicesDep, draft: DraftDep, form: DraftFormDep) -> Response:
    """Keep a text in the history without making it the draft's, so that taking the other's text loses nothing."""
    text = DraftText(admin.name, _text(form), draft.name, draft.revision)
    await services.web.database.write(study_drafts.set_aside, draft.id, text)
    return JSONResponse({})


@router.post("/open")
async def open_study(
    admin: OwnDep, services: ServicesDep, draft: DraftDep, form: AdminFormDep, grids: GridsDep
) -> Response:
    """Let participants into the study as the draft is now: a new version, which never changes."""
    back = f"/admin/drafts/{draft.id}"
    if first(form, "revision") != str(draft.revision):
        return back_to(back, "draft_conflict")
    view = await asyncio.to_thread(drafting.view, draft.source, f"the draft of {draft.name}")
    if view.file is None:
        return back_to(back, "draft_faulty")
    versions, web = services.versions, services.web
    file = await asyncio.to_thread(versions.as_opened, view.file, grids)
    found = await asyncio.to_thread(_problems, file, versions, True)
    if not all(problem.warning for problem in found):
        return back_to(back, "draft_faulty")
    name = file.study.name
    if await web.database.read(study_openings.is_taken, name, draft.id):
        return back_to(back, "draft_name_taken")
    try:
        version, number = await versions.prepare_draft(web.database, file)
    except StudyError as error:
        log.warning("the draft %d is not opened: %s", draft.id, error)
        return back_to(back, "draft_refused")
    if not await services.control.run_in_each(PrepareVersion(name, version.sha256), VERSION_TIMEOUT_S):
        log.warning("the draft %d is not opened: not every server process is ready for it", draft.id)
        return back_to(back, "draft_refused")
    at = await asyncio.shield(web.database.write(_open, draft, (name, number, version.sha256), admin.name))
    if at is None:
        return back_to(back, "draft_name_taken")
    versions.open(replace(version, opened_at=at))
    await services.control.run_in_each(OpenVersion(name, version.sha256, at), OPEN_TIMEOUT_S)
    return back_to(back, await web.database.read(_outcome, name, draft.id))


def _open(connection: Connection, draft: StudyDraft, version: tuple[str, int, str], by: str) -> float | None:
    """Store that a version is open, with its line in the audit log; return when, in Unix seconds. None if the
    draft was deleted in between, or another one was opened under this name."""
    name, number, sha256 = version
    if study_openings.is_taken(connection, name, draft.id) or study_drafts.get(connection, draft.id) is None:
        return None
    at = study_openings.open_study(connection, (name, number), (draft.id, draft.revision), by)
    detail = {"study": name, "draft": draft.id, "revision": draft.revision, "version": sha256}
    audit.add(connection, by, "open study", detail)
    return at.timestamp()


def _outcome(connection: Connection, name: str, draft: int) -> str:
    """Return what is said of a study that was opened just now."""
    if name in interventions.paused_studies(connection):
        return "draft_opened_paused"
    others = (one for one in study_openings.newest(connection).values() if one.study != name)
    is_renamed = any(one.draft_id == draft and one.is_open for one in others)
    return "draft_opened_renamed" if is_renamed else "draft_opened"


@router.post("/close")
async def close_study(admin: OwnDep, services: ServicesDep, draft: DraftDep, form: AdminFormDep) -> Response:
    """Let nobody new in. Those who are in the study can finish it."""
    name = first(form, "study")
    opened = (await services.web.database.read(study_openings.newest)).get(name)
    if opened is None or opened.draft_id != draft.id:
        raise HTTPException(404, "This draft has no such study. Open it from the list of studies.")
    done = await asyncio.shield(services.web.database.write(_close, name, admin.name))
    return back_to(f"/admin/drafts/{draft.id}", "draft_closed" if done else "")


def _close(connection: Connection, name: str, by: str) -> bool:
    done = study_openings.close_study(connection, name, by)
    if done:
        audit.add(connection, by, "close study", {"study": name})
    return done
