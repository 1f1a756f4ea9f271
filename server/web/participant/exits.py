"""Routes for participants who leave: declined, failed the entry checks, withdrawn."""

from typing import Any

from fastapi import APIRouter, Request, Response

from server.participation import progress
from server.participation.recruiter_links import recruitment_of, turned_away
from server.store.participants import Participant
from server.study.recruitment import Exit
from server.web import deletion, guess_limits
from server.web.auth import forget_cookie
from server.web.control import ControlDep
from server.web.dependencies import FormDep, KnownStudy, KnownStudyDep, PageResponse, ParticipantDep, Web, WebDep, page
from server.web.forms import first
from server.web.participant import views

router = APIRouter(prefix="/s/{name}")


@router.get("/declined")
async def declined(request: Request, known: KnownStudyDep, web: WebDep) -> Response:
    """Show the page for somebody who declined."""
    return _turned_away(page(request, web, known.study), known, known.study.recruitment.declined, "declined")


@router.get("/unsuitable")
async def unsuitable(request: Request, known: KnownStudyDep, web: WebDep) -> Response:
    """Show the screened-out code to somebody whose device failed the entry checks; nothing was stored yet."""
    outcome = known.study.recruitment.screened_out
    return _turned_away(page(request, web, known.study), known, outcome, "unsuitable")


def _turned_away(made: PageResponse, known: KnownStudy, outcome: Exit, template: str) -> Response:
    recruitment = known.study.recruitment
    person, extra = recruitment_of(recruitment, dict(made.request.query_params))
    return made.render(f"participant/{template}.html", **turned_away(recruitment, outcome, person, extra))


def _codes_of_all(known: KnownStudy) -> set[str]:
    """Return the study's fixed codes, which do not identify a participant."""
    recruitment = known.study.recruitment
    outcomes = (recruitment.completed, recruitment.screened_out, recruitment.unpaired, recruitment.declined)
    return {outcome.code.upper() for outcome in outcomes if outcome.code}


@router.get("/withdraw")
async def withdraw_page(request: Request, known: KnownStudyDep, web: WebDep, participant: ParticipantDep) -> Response:
    """Ask whether somebody really wants to leave; without the cookie, by the completion code."""
    return page(request, web, known.study, participant).render("participant/withdraw.html", code="", wrong="")


@router.post("/withdraw")
async def withdraw(
    request: Request, known: KnownStudyDep, web: WebDep, participant: ParticipantDep, form: FormDep, control: ControlDep
) -> Response:
    """Delete everything about the participant; a count remains. After several wrong codes the next try has to wait."""
    code = first(form, "code").strip().upper()
    made = page(request, web, known.study, participant)
    leaving = participant
    if leaving is None and code in _codes_of_all(known):
        return made.render("participant/withdraw.html", 422, code=code, wrong="code_of_all")
    if leaving is None:
        outcome, leaving = await _by_code(request, known, web, code)
        if leaving is None:
            status, wrong = (429, "wait") if outcome.left is None else (422, "code_wrong")
            return made.render("participant/withdraw.html", status, code=code, wrong=wrong)
    debriefing = views.debriefing_of(made, leaving)
    await deletion.delete(web, control, leaving.id)
    gone = PageResponse(request, web, made.language, known.study)
    words: dict[str, Any] = {"kind": "withdrawn", "outcome": Exit(), "debriefing": debriefing}
    response = gone.render("participant/ended.html", **words, back=None)
    if participant is not None:
        forget_cookie(response, known.study.name, secure=web.csrf.secure)
    return response


async def _by_code(
    request: Request, known: KnownStudy, web: Web, code: str
) -> tuple[guess_limits.GuessOutcome, Participant | None]:
    """Return the participant with this completion code. A code has no account name, so wrong ones are counted by
    address alone."""
    found: Participant | None = None

    async def look() -> bool:
        nonlocal found
        found = await web.database.read(progress.by_code, known.study.name, code)
        return found is not None

    outcome = await guess_limits.guarded(web, guess_limits.origin_of_address(web, request, guess_limits.CODE), "", look)
    return outcome, found
