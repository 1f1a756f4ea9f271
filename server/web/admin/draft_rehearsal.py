"""Routes that let simulated participants take part in a draft."""

import asyncio
from functools import partial

from fastapi import APIRouter, HTTPException, Request, Response

from server.monitoring.rehearsals import MAX_BOTS, TIMEOUT_S, Rehearsal
from server.participation.draft_checks import draft_problems
from server.store import audit
from server.store.database import Database
from server.study import drafting
from server.web.admin.draft_pages import DraftDep, WholeDraftDep
from server.web.admin.players import games_of_all
from server.web.admin.rendering import AdminPage, back_to
from server.web.admin.researcher_auth import AdminFormDep, OwnDep
from server.web.forms import whole_number
from server.web.services import Services, ServicesDep

router = APIRouter(prefix="/admin/drafts/{draft}/bots")


@router.get("")
async def outcome(request: Request, admin: OwnDep, services: ServicesDep, draft: DraftDep) -> Response:
    """Show the newest rehearsal of the draft."""
    page = AdminPage(request, admin)
    found = services.rehearsals.of(draft.id, await _of_other_processes(services))
    limits = {"most": MAX_BOTS, "timeout_min": int(TIMEOUT_S / 60)}
    return page.render("draft_bots.html", tab="drafts", draft=draft, rehearsal=found, **limits)


@router.post("")
async def start(admin: OwnDep, services: ServicesDep, draft: WholeDraftDep, form: AdminFormDep) -> Response:
    """Begin a rehearsal, unless one is running or somebody plays here: bots would take the time of their games."""
    number, here = whole_number(form, "number"), f"/admin/drafts/{draft.id}/bots"
    if not 1 <= number <= MAX_BOTS:
        raise HTTPException(400, f"{number} simulated participants are not possible. Give 1 to {MAX_BOTS}.")
    if await games_of_all(services):
        return back_to(here, "bots_players")
    if not await asyncio.to_thread(_can_be_opened, draft.source, services):
        return back_to(f"/admin/drafts/{draft.id}", "draft_faulty")
    if any(one.is_running for one in await _of_other_processes(services)):
        return back_to(here, "bots_busy")
    rehearsal = Rehearsal(draft.id, draft.revision, number, admin.name)
    if not services.rehearsals.start(rehearsal, draft.source, partial(_note, services.web.database)):
        return back_to(here, "bots_busy")
    return back_to(here)


def _can_be_opened(source: str, services: Services) -> bool:
    """Return whether the draft has no errors. The bots' server loads its models: a file, a class or an address that the
    draft may not name is an error, too."""
    file, versions = drafting.view(source).file, services.versions
    found = [] if file is None else draft_problems(versions.as_opened(file, {}), versions.of_files())
    return file is not None and all(problem.warning for problem in found)


async def _of_other_processes(services: Services) -> list[Rehearsal]:
    return [one for process in await services.live.peers.processes() for one in process.rehearsals]


async def _note(database: Database, over: Rehearsal) -> None:
    counts = {key: over.outcome.get(key) for key in ("started", "completed", "dropped", "episodes")}
    detail = {"draft": over.draft, "revision": over.revision, "bots": over.number, **counts}
    detail |= {"violations": len(over.outcome.get("violations", ())), "failed": bool(over.failure)}
    await database.write(audit.add, over.by, "study draft rehearsed", detail)
