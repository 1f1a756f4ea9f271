"""The route by which a consent page adds to the counts of those who came: nothing about who they are."""

from fastapi import APIRouter, HTTPException, Response

from server.store import arrivals
from server.web.dependencies import FormDep, OpenStudyDep, WebDep
from server.web.forms import first

router = APIRouter()


@router.post("/s/{name}/arrivals")
async def count(opened: OpenStudyDep, web: WebDep, form: FormDep) -> Response:
    """One more browser that opened the link, was turned away by the entry checks, or whose person declined."""
    kind, reason = first(form, "kind"), first(form, "reason")
    if kind not in arrivals.KINDS or reason not in arrivals.REASONS:
        raise HTTPException(400, "there is no such count")
    await web.database.write(arrivals.count, opened.id, kind, reason)
    return Response(status_code=204)
