"""Routes of studies that are written in the dashboard: the list of drafts, new ones, the editor, the history."""

import asyncio
import difflib
from collections.abc import Mapping
from dataclasses import asdict, replace
from typing import Annotated, Any, Final

from fastapi import APIRouter, Depends, HTTPException, Request, Response
from jinja2.utils import htmlsafe_json_dumps
from sqlalchemy import Connection

from server.participation.draft_checks import known_names
from server.participation.study_changes import Versions
from server.settings import ROOT
from server.store import audit, interventions, kitchens, study_drafts, study_openings
from server.store.study_drafts import DraftText, StudyDraft
from server.study.drafting import STUDY_NAME, from_template, named, view
from server.study.reference import study_reference
from server.study.sections import SECTIONS
from server.web.admin.rendering import AdminPage, back_to
from server.web.admin.researcher_auth import AdminFormDep, OwnDep, form_session
from server.web.dependencies import WebDep
from server.web.forms import Form, first, read_form, whole_number
from server.web.security_headers import OURSELVES
from server.web.services import ServicesDep

router = APIRouter(prefix="/admin/drafts")
MAX_DRAFT_BYTES: Final = 9 * 1024 * 1024  # of a form: up to three texts, whose other letters take nine bytes
_MOST: Final = 2**31  # numbers in the database
MAX_TITLE_LENGTH: Final = 200
TEMPLATES: Final = {
    "external_predictor": ("The published study", "Three conditions, five kitchens, two agents, ten rounds."),
    "quick_look": ("A quick look", "A short study of a few minutes, to try things out."),
    "classic_kitchens": (
        "The classic kitchens",
        "The published design in the five kitchens of overcooked_ai: three conditions, two agents, ten rounds.",
    ),
    "trust": ("Trust", "Right or misleading marks; Trust in Automation and NASA-TLX after six rounds; a debriefing."),
    "two_people": ("Two people", "Two participants cook with each other."),
}


async def draft_at(draft: int, web: WebDep) -> StudyDraft:
    """Return the draft with this number. Answers 404 where there is none."""
    found = await web.database.read(study_drafts.get, draft) if 0 < draft < _MOST else None
    if found is None:
        raise HTTPException(404, "This draft does not exist. Open it from the list of drafts.")
    return found


async def kitchen_grids(web: WebDep) -> Mapping[str, str]:
    """Return the grids of the kitchens that were saved in the dashboard, which a draft may name."""
    found: Mapping[str, str] = await web.database.read(kitchens.grids)
    return found


GridsDep = Annotated[Mapping[str, str], Depends(kitchen_grids)]


async def whole_draft(
    draft: Annotated[StudyDraft, Depends(draft_at)], services: ServicesDep, grids: GridsDep
) -> StudyDraft:
    """Return the draft with its kitchens and trained models in its text, as it would be opened."""
    return replace(draft, source=await asyncio.to_thread(_whole, draft.source, services.versions, grids))


def _whole(source: str, versions: Versions, grids: Mapping[str, str]) -> str:
    file = view(source).file
    return source if file is None else versions.as_opened(file, grids).text


async def _draft_form(request: Request, web: WebDep) -> Form:
    """Return a form that may hold the text of a whole study. Answers 400 to a NUL character, which PostgreSQL cannot
    store; the draft's problems list other control characters with their lines."""
    session = form_session(request)
    form = await read_form(request, web.csrf, session, controls=True, largest=MAX_DRAFT_BYTES)
    if any("\x00" in value for values in form.values() for value in values):
        raise HTTPException(400, "The text contains a NUL character. Delete it and save again.")
    return form


DraftDep = Annotated[StudyDraft, Depends(draft_at)]
WholeDraftDep = Annotated[StudyDraft, Depends(whole_draft)]
DraftFormDep = Annotated[Form, Depends(_draft_form)]


def templates_there() -> dict[str, tuple[str, str]]:
    """Return the templates whose study file is there: file -> title and sentence."""
    return {name: words for name, words in TEMPLATES.items() if (ROOT / "studies" / f"{name}.yaml").is_file()}


@router.get("")
async def drafts(request: Request, admin: OwnDep, web: WebDep) -> Response:
    """List all drafts."""
    rows = await web.database.read(study_drafts.every)
    opened = await web.database.read(study_openings.newest)
    states = {row.id: state_of(row, opened) for row in rows}
    return AdminPage(request, admin).render("drafts.html", tab="drafts", rows=rows, states=states)


def state_of(draft: StudyDraft, opened: dict[str, study_openings.StudyOpening]) -> str:
    """Return draft, open, closed, or changed (open, and the draft has been changed since)."""
    of_draft = [one for one in opened.values() if one.draft_id == draft.id]
    current = [one for one in of_draft if one.is_open]
    if current:
        return "open" if current[-1].draft_revision == draft.revision else "changed"
    return "closed" if of_draft else "draft"


@router.get("/new")
async def new_page(request: Request, admin: OwnDep) -> Response:
    """Ask for a template, a name and a title."""
    return _new_page(request, admin, {}, "")


def _new_page(request: Request, admin: OwnDep, given: dict[str, str], wrong: str) -> Response:
    status = 422 if wrong else 200
    context: dict[str, Any] = {"templates": templates_there(), "given": given, "wrong": wrong}
    return AdminPage(request, admin).render("draft_new.html", status, tab="drafts", **context)


@router.post("")
async def create(request: Request, admin: OwnDep, services: ServicesDep, form: AdminFormDep) -> Response:
    """Begin a draft from a template."""
    given = {name: first(form, name).strip() for name in ("template", "name", "title")}
    name, title = given["name"], given["title"][:MAX_TITLE_LENGTH]
    wrong = ""
    if given["template"] not in templates_there():
        wrong = "Choose a template."
    elif not STUDY_NAME.fullmatch(name):
        wrong = "The name has at most 40 lowercase letters, digits, - and _, and begins with a letter."
    elif name in services.web.studies.names():
        wrong = f"This server already has a study {name!r} on this server. Choose another name."
    if wrong:
        return _new_page(request, admin, given, wrong)
    template = (ROOT / "studies" / f"{given['template']}.yaml").read_text("utf-8")
    text = await asyncio.to_thread(from_template, template, name, title)
    made = DraftText(admin.name, text, name, note="created")
    number = await services.web.database.write(study_drafts.create, made)
    return back_to(f"/admin/drafts/{number}")


@router.get("/{draft}")
async def editor(request: Request, admin: OwnDep, web: WebDep, draft: DraftDep, grids: GridsDep) -> Response:
    """Show the editor: the form on the left, the YAML on the right."""
    opened = await web.database.read(study_openings.newest)
    paused = await web.database.read(interventions.paused_studies)
    of_draft = [one for one in opened.values() if one.draft_id == draft.id]
    mine = next((one for one in reversed(of_draft) if one.is_open), None)
    last = mine or next(reversed(of_draft), None)
    state = state_of(draft, opened)
    about: dict[str, Any] = {
        "id": draft.id,
        "revision": draft.revision,
        "source": draft.source,
        "schema": (await asyncio.to_thread(study_reference)).schema,
        "sections": [asdict(section) for section in SECTIONS],
        "known": await asyncio.to_thread(known_names, sorted(grids)),
        "kitchens": sorted(grids),
        "author": admin.name,
    }
    page = AdminPage(request, admin)
    # Not the template's filter `tojson`, which sorts keys: the schema has them in the order of the form.
    words = htmlsafe_json_dumps(about, sort_keys=False)
    context: dict[str, Any] = {"draft": draft, "state": state, "opening": mine, "last": last, "about": words}
    context["address"] = "" if mine is None else page.study_address(mine.study)
    others = [one.study for one in of_draft if one.is_open and one is not mine]
    context["others"] = {name: page.study_address(name) for name in others}  # under former names of the draft
    context["paused"] = mine is not None and mine.study in paused
    response = page.render("draft.html", tab="drafts", **context)
    return page.allow(response, frames=OURSELVES)  # the kitchen editor in a dialog


@router.get("/{draft}/history")
async def history(request: Request, admin: OwnDep, web: WebDep, draft: DraftDep) -> Response:
    """List every stored text of the draft."""
    rows = await web.database.read(study_drafts.history, draft.id)
    return AdminPage(request, admin).render("draft_history.html", tab="drafts", draft=draft, rows=rows, shown=None)


@router.get("/{draft}/history/{number}")
async def earlier(request: Request, number: int, admin: OwnDep, web: WebDep, draft: DraftDep) -> Response:
    """Show one text of the history, and how it differs from the newest."""
    rows = await web.database.read(study_drafts.history, draft.id)
    shown = next((row for row in rows if row.id == number), None)
    if shown is None:
        raise HTTPException(404, "The history of this draft has no such text. Open it from the history.")
    lines = await asyncio.to_thread(_difference, draft.source, shown.source)
    page = AdminPage(request, admin)
    context: dict[str, Any] = {"draft": draft, "rows": rows, "shown": shown, "lines": lines}
    return page.render("draft_history.html", tab="drafts", **context)


def _difference(newest: str, earlier: str) -> list[str]:
    return list(difflib.unified_diff(newest.splitlines(), earlier.splitlines(), n=2, lineterm=""))[2:]


@router.post("/{draft}/restore")
async def restore(admin: OwnDep, web: WebDep, draft: DraftDep, form: AdminFormDep) -> Response:
    """Make a text of the history the newest; the one that was the newest stays in the history."""
    found = await web.database.read(study_drafts.version, draft.id, whole_number(form, "version"))
    if found is None:
        raise HTTPException(404, "The history of this draft has no such text. Open it from the history.")
    name = await asyncio.to_thread(named, found.source) or draft.name
    text = DraftText(admin.name, found.source, name, draft.revision, "restored")
    saved = await web.database.write(study_drafts.save, draft.id, text)
    done = isinstance(saved, StudyDraft)
    return back_to(f"/admin/drafts/{draft.id}", "draft_restored" if done else "draft_conflict")


@router.post("/{draft}/delete")
async def delete(admin: OwnDep, web: WebDep, draft: DraftDep, form: AdminFormDep) -> Response:  # noqa: ARG001
    """Delete the draft, unless a study that was opened from it is open."""
    if not await asyncio.shield(web.database.write(_delete, draft, admin.name)):
        return back_to(f"/admin/drafts/{draft.id}", "draft_is_open")
    return back_to("/admin/drafts", "draft_deleted")


def _delete(connection: Connection, draft: StudyDraft, by: str) -> bool:
    """Delete a draft with its line in the audit log. False: a study that was opened from it is open."""
    if any(one.draft_id == draft.id and one.is_open for one in study_openings.newest(connection).values()):
        return False
    study_drafts.delete(connection, draft.id)
    audit.add(connection, by, "study draft deleted", {"draft": draft.id, "study": draft.name})
    return True
