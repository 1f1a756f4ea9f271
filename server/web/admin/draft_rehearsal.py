"""Routes that let simulated participants walk through a draft."""

import asyncio
from functools import partial

from fastapi import APIRouter, HTTPException, Request, Response

from server.monitoring.rehearsals import MOST_BOTS, Rehearsal
from server.store import audit
from server.store.database import Database
from server.study import drafting
from server.web.admin.draft_pages import DraftDep, WholeDraftDep
from server.web.admin.rendering import AdminPage, back_to
from server.web.admin.researcher_auth import AdminFormDep, OwnDep
from server.web.forms import first
from server.web.services import ServicesDep

router = APIRouter(prefix="/admin/drafts/{draft}/bots")


@router.get("")
async def outcome(request: Request, admin: OwnDep, services: ServicesDep, draft: DraftDep) -> Response:
    """How the newest rehearsal of the draft goes or went."""
    page = AdminPage(request, admin)
    found = services.rehearsals.of(draft.id)
    return page.render("draft_bots.html", tab="drafts", draft=draft, rehearsal=found, most=MOST_BOTS)


@router.post("")
async def start(admin: OwnDep, services: ServicesDep, draft: WholeDraftDep, form: AdminFormDep) -> Response:
    """Begin a rehearsal, unless one is running or somebody plays here: bots would take the time of their games."""
    words, here = first(form, "number"), f"/admin/drafts/{draft.id}/bots"
    if not (words.isascii() and words.isdigit() and 1 <= int(words[:4]) <= MOST_BOTS):
        raise HTTPException(400, f"give 1 to {MOST_BOTS} simulated participants")
    if len(services.games):
        return back_to(here, "bots_players")
    view = await asyncio.to_thread(drafting.view, draft.source)
    if view.file is None:
        return back_to(f"/admin/drafts/{draft.id}", "draft_faulty")
    rehearsal = Rehearsal(draft.id, draft.revision, int(words), admin.name)
    if not services.rehearsals.start(rehearsal, draft.source, partial(_note, services.web.database)):
        return back_to(here, "bots_busy")
    return back_to(here)


async def _note(database: Database, over: Rehearsal) -> None:
    counts = {key: over.outcome.get(key) for key in ("started", "completed", "dropped", "episodes")}
    detail = {"draft": over.draft, "revision": over.revision, "bots": over.number, **counts}
    detail |= {"violations": len(over.outcome.get("violations", ())), "failed": bool(over.failure)}
    await database.write(audit.add, over.by, "study draft rehearsed", detail)
