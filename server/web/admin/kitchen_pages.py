"""Routes of the kitchen editor: the list of own kitchens, one kitchen, what is wrong with it, saving. Owners only."""

import asyncio
import re
from typing import Any, Final

from fastapi import APIRouter, HTTPException, Request, Response
from fastapi.responses import JSONResponse

from overcooked.layout import layout_names, load_layout, parse_layout
from overcooked.layout_file import LayoutError
from overcooked.other_names import OTHER_NAMES
from server.participation.episode_specs import layout_of
from server.participation.kitchen_files import write_kitchens
from server.participation.own_kitchens import studies_with
from server.store import audit, kitchens
from server.store.kitchens import KitchenConflict, StoredKitchen
from server.web.admin import kitchen_findings
from server.web.admin.rendering import AdminPage, back_to
from server.web.admin.researcher_auth import AdminFormDep, OwnDep
from server.web.dependencies import Web, WebDep
from server.web.forms import Form, first, whole_number
from server.web.security_headers import OURSELVES
from server.web.services import ServicesDep

router = APIRouter(prefix="/admin")
NAME: Final = re.compile(r"[a-z][a-z0-9_]{0,39}")
MAX_TEXT: Final = 20_000
EMPTY: Final = ("XXXXXXX", "X1   2X", "X     X", "X     X", "XXXXXXX")


@router.get("/kitchens")
async def own_kitchens(request: Request, admin: OwnDep, web: WebDep) -> Response:
    """List the kitchens that were drawn here, and the bundled ones to begin with."""
    rows = [
        {"kitchen": one, "layout": parse_layout(one.grid or "", one.name), "studies": _studies(web, one.name)}
        for one in await web.database.read(kitchens.newest)
    ]
    bundled = [load_layout(name) for name in layout_names()]
    return AdminPage(request, admin).render("kitchens.html", tab="kitchens", rows=rows, bundled=bundled)


@router.get("/kitchens/new")
async def new_kitchen(request: Request, admin: OwnDep) -> Response:
    """Show the editor with an empty kitchen, a copy of a bundled one (`copy`), or a grid from a draft (`grid`)."""
    copied, grid = request.query_params.get("copy", ""), request.query_params.get("grid", "")[:MAX_TEXT]
    rows = list(load_layout(copied).grid) if copied in layout_names() else grid.splitlines() or list(EMPTY)
    return _editor(request, admin, "", rows, [], 0)


@router.get("/kitchen/{kitchen}")
async def edit_kitchen(request: Request, kitchen: str, admin: OwnDep, web: WebDep) -> Response:
    """Show the newest version of a kitchen in the editor, or an earlier one (`version`)."""
    history = await web.database.read(kitchens.of_name, kitchen)
    wanted = request.query_params.get("version", "")
    shown = next((one for one in history if str(one.version) == wanted and one.grid), None)
    shown = shown or next((one for one in history[:1] if one.grid), None)
    if shown is None or shown.grid is None:
        raise HTTPException(404, f"There is no kitchen {kitchen!r}. Open it from the list of kitchens.")
    return _editor(request, admin, kitchen, shown.grid.splitlines(), history, shown.version)


def _editor(
    request: Request, admin: OwnDep, name: str, rows: list[str], history: list[StoredKitchen], shown: int
) -> Response:
    newest = history[0].version if history else 0
    page = AdminPage(request, admin)
    embedded = request.query_params.get("in") == "draft"  # in a dialog of the study builder
    start = {"name": name, "rows": rows, "version": newest, "token": page.form_token(), "embedded": embedded}
    context: dict[str, Any] = {"start": start, "history": history, "shown": shown, "newest": newest}
    context["suggested"] = name or request.query_params.get("name", "")
    response = page.render("kitchen.html", tab="kitchens", name=name, embedded=embedded, **context)
    if not embedded:
        return response
    response.headers["X-Frame-Options"] = "SAMEORIGIN"
    return page.allow(response, framed_by=OURSELVES)


@router.post("/kitchens/check")
async def check_kitchen(admin: OwnDep, services: ServicesDep, form: AdminFormDep) -> dict[str, Any]:  # noqa: ARG001
    """Return what is wrong with a grid and what can be reached in it; also for the text of a `.layout` file."""
    own_models = services.settings.own_models
    return await asyncio.to_thread(kitchen_findings.findings, _grid(form), _name(form), own_models)


@router.post("/kitchens/trial")
async def try_kitchen(admin: OwnDep, form: AdminFormDep) -> dict[str, Any]:  # noqa: ARG001 - checks who asks
    """Return the points of two planners."""
    return await kitchen_findings.trial(_grid(form))


def _bad_name(name: str) -> str:
    """Return why a name cannot be used, with one that is like it."""
    alike = re.sub(r"[^a-z0-9]+", "_", name.lower()).strip("_")[:40]
    example = alike if NAME.fullmatch(alike) else "my_kitchen"
    rule = "Use lowercase letters, digits and _, a letter first, and at most 40 characters"
    return f"{f'{name!r} cannot be the name' if name else 'Give the kitchen a name'}. {rule}, for example {example}."


@router.post("/kitchens/save")
async def save_kitchen(admin: OwnDep, services: ServicesDep, form: AdminFormDep) -> Response:
    """Store a new version. Answers 409 where somebody else stored one in the meantime, or a study plays in it."""
    web = services.web
    name, opened = first(form, "name").strip(), whole_number(form, "version")
    if NAME.fullmatch(name) is None:
        raise HTTPException(400, _bad_name(name))
    if name in layout_names() or name in OTHER_NAMES:
        raise HTTPException(400, f"{name} is the name of a bundled kitchen. Give your kitchen another name.")
    try:
        layout = parse_layout(_grid(form), name)
    except LayoutError as error:
        raise HTTPException(400, str(error)) from None
    if (busy := _bound(web, name, layout.text)) is not None:
        return JSONResponse({"detail": f"{busy} Save the change under another name."}, 409)
    try:
        saved = await _stored(web, admin.name, name, layout.text, opened)
    except KitchenConflict as conflict:
        return JSONResponse({"detail": str(conflict), "newest": conflict.newest.version}, 409)
    await asyncio.to_thread(write_kitchens, services.settings.own_kitchens, {name: layout.text})
    return JSONResponse({"name": saved.name, "version": saved.version})


@router.post("/kitchen/{kitchen}/remove")
async def remove_kitchen(kitchen: str, admin: OwnDep, services: ServicesDep, form: AdminFormDep) -> Response:  # noqa: ARG001 - checks the form
    """Take a kitchen out of the list; its history stays."""
    web = services.web
    history = await web.database.read(kitchens.of_name, kitchen)
    if not history or history[0].grid is None:
        raise HTTPException(404, f"There is no kitchen {kitchen!r}. Open it from the list of kitchens.")
    if (busy := _bound(web, kitchen, None)) is not None:
        raise HTTPException(409, f"{busy} Remove it when the study is closed.")
    try:
        await _stored(web, admin.name, kitchen, None, history[0].version)
    except KitchenConflict as conflict:
        raise HTTPException(409, str(conflict)) from None
    await asyncio.to_thread(write_kitchens, services.settings.own_kitchens, {kitchen: None})
    return back_to("/admin/kitchens", "kitchen_removed")


async def _stored(web: Web, by: str, name: str, grid: str | None, opened: int) -> StoredKitchen:
    """Store a version with its line in the audit log, in one transaction. Raises KitchenConflict."""

    def store(connection: Any) -> StoredKitchen:
        saved = kitchens.save(connection, name, grid, by, opened)
        action = "save kitchen" if grid is not None else "remove kitchen"
        audit.add(connection, by, action, {"kitchen": name, "version": saved.version})
        return saved

    return await asyncio.shield(web.database.write(store))


def _bound(web: Web, kitchen: str, grid: str | None) -> str | None:
    """Return why a kitchen cannot change to `grid`: data and models know it by its name. None: it can."""
    for name in _studies(web, kitchen):
        opened = web.studies.open(name)
        places = [] if opened is None else [*opened[1].layouts, opened[1].tutorial.layout]
        if any(one.name == kitchen and layout_of(one).text != grid for one in places):
            return f"The study {name} is served with the kitchen {kitchen}."
    return None


def _studies(web: Web, kitchen: str) -> list[str]:
    opened = {name: web.studies.open(name) for name in web.studies.names()}
    return studies_with({name: found[1] for name, found in opened.items() if found is not None}, kitchen)


def _grid(form: Form) -> str:
    text = first(form, "grid")
    if len(text) > MAX_TEXT:
        raise HTTPException(
            400, f"This text has {len(text):,} characters; a kitchen has at most {MAX_TEXT:,}. Shorten it."
        )
    return text


def _name(form: Form) -> str:
    name = first(form, "name").strip()
    return name if NAME.fullmatch(name) else ""
