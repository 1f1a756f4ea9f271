"""Routes of the data view: participants, episodes and answers of a study as a table, and as CSV."""

import asyncio
import re
import time
from typing import Final

from fastapi import APIRouter, HTTPException, Request, Response
from sqlalchemy import Connection

from server.monitoring.data_rows import asked_of_some, csv_head, csv_rows, shown_rows
from server.store import audit
from server.store.data_view import PAGE_ROWS, TABLES, DataQuery, columns_of, data_page
from server.web.admin.rendering import AdminPage, study_at
from server.web.admin.researcher_auth import ActDep, AdminFormDep
from server.web.dependencies import Web, WebDep
from server.web.forms import first
from server.web.services import ServicesDep

router = APIRouter(prefix="/admin/s/{name}")
CHUNK_ROWS: Final = 500
MAX_FILTER_LENGTH: Final = 200


@router.get("/data")
async def data_view(request: Request, name: str, admin: ActDep, web: WebDep) -> Response:
    """Show one page of a table; in blind mode, without what reveals a condition."""
    given = request.query_params
    wanted = _query(web, name, {key: given.get(key, "") for key in _KEYS}, admin.blind)
    number = _page_number(given.get("page", ""))
    found = await web.database.read(data_page, wanted, (number - 1) * PAGE_ROWS)
    pages = max(1, -(-found.total // PAGE_ROWS))
    if number > pages:
        number = pages
        found = await web.database.read(data_page, wanted, (number - 1) * PAGE_ROWS)
    _, study = study_at(web, name)
    return AdminPage(request, admin).render(
        "data.html",
        tab="data",
        study=study,
        wanted=wanted,
        tables=list(TABLES),
        columns=found.columns,
        rows=list(zip(found.people, shown_rows(found), strict=True)),
        total=found.total,
        number=number,
        pages=pages,
    )


@router.post("/data.csv")
async def download(name: str, admin: ActDep, services: ServicesDep, form: AdminFormDep) -> Response:
    """Send all rows of the table, over all pages. They show the conditions, so this is refused in blind mode."""
    web = services.web
    wanted = _query(web, name, {key: first(form, key) for key in _KEYS}, admin.blind)
    if admin.blind:
        raise HTTPException(409, "A download shows the conditions. Turn blind mode off first.")
    detail = {"study": name, "table": wanted.table} | ({"filtered": True} if wanted.contains else {})
    await asyncio.shield(web.database.write(audit.add, admin.name, "download table", detail))
    headers = {
        "Content-Disposition": f'attachment; filename="{name}-{wanted.table}.csv"',
        "Cache-Control": "no-store",
    }
    await services.games.loop.between_batches()
    text = await web.database.read(_text, wanted)
    return Response(text, media_type="text/csv; charset=utf-8", headers=headers)


def _text(connection: Connection, wanted: DataQuery) -> str:
    """Return all rows as CSV, as they are at one moment: if participants answer during the download, the rows after
    theirs would move. Between two pieces the live games' thread can run."""
    pieces = [csv_head(columns_of(wanted))]
    done, total = 0, 1
    while done < total:
        page = data_page(connection, wanted, done, CHUNK_ROWS)
        pieces.append(csv_rows(page))
        done, total = done + CHUNK_ROWS, page.total
        time.sleep(0)
    return "".join(pieces)


_KEYS: Final = ("table", "contains", "column", "sort")


def _query(web: Web, name: str, given: dict[str, str], blind: bool) -> DataQuery:
    """Return what was asked for. Answers 404 for an unknown table; an unknown or hidden column is left
    out."""
    study_ids, _ = study_at(web, name)
    table = given["table"] or next(iter(TABLES))
    if table not in TABLES:
        raise HTTPException(404, f"There is no table {table!r}. Choose one of {', '.join(TABLES)}.")
    versions = [study for number in study_ids if (study := web.studies.version(number)) is not None]
    wanted = DataQuery(table, study_ids, blind=blind, hidden_questions=asked_of_some(versions) if blind else ())
    names = {column.name for column in columns_of(wanted)}
    return DataQuery(
        table,
        study_ids,
        contains=given["contains"].replace("\x00", "")[:MAX_FILTER_LENGTH],
        column=given["column"] if given["column"] in names else "",
        sort=given["sort"] if given["sort"].removeprefix("-") in names else "",
        blind=blind,
        hidden_questions=wanted.hidden_questions,
    )


def _page_number(text: str) -> int:
    return int(text) if re.fullmatch(r"[1-9][0-9]{0,6}", text) else 1
