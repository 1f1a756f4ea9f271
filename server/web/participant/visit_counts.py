"""The route by which a consent page increments visit counts, without data about persons."""

from fastapi import APIRouter, HTTPException, Response

from server.store import arrivals
from server.web.dependencies import FormDep, OpenStudyDep, WebDep
from server.web.forms import first

router = APIRouter()


@router.post("/s/{name}/arrivals")
async def count(opened: OpenStudyDep, web: WebDep, form: FormDep) -> Response:
    """Count a browser that opened the link, failed the entry checks, or whose user declined."""
    kind, reason = first(form, "kind"), first(form, "reason")
    if kind not in arrivals.KINDS or reason not in arrivals.REASONS:
        raise HTTPException(400, "There is no such count. Reload the page.")
    await web.database.write(arrivals.count, opened.id, kind, reason)
    return Response(status_code=204)
