"""Routes of a participant: read the request, ask `participation.progress`, render. A GET only records a visit."""

import asyncio
import contextlib

from fastapi import APIRouter, Request, Response, WebSocket, WebSocketDisconnect

from server.participation import progress
from server.participation.episode_specs import layout_of
from server.participation.page_answers import check_page
from server.participation.recruiter_links import may_start_new
from server.play.close_codes import CloseCode
from server.store import participants, study_openings
from server.store.participants import Participant
from server.study.definition import Study
from server.study.steps import episodes_of, step_address
from server.study.text import Text
from server.web.auth import forget_cookie
from server.web.dependencies import (
    AnswersFormDep,
    FormDep,
    KnownStudyDep,
    ParticipantDep,
    Web,
    WebDep,
    page,
)
from server.web.forms import Form, first
from server.web.participant import consent_pages, visit_counts
from server.web.participant.consent_pages import next_person, see_other
from server.web.participant.views import Filled, render_step

router = APIRouter()
router.include_router(visit_counts.router)
router.include_router(consent_pages.router)
MAX_PICTURES = 5  # of kitchens of one study
CHECK_S = 15
MAX_ECHOES = 20
ECHOED_CHARACTERS = 16


@router.get("/")
async def choose(request: Request, web: WebDep) -> Response:
    """Ask which study to take part in."""
    closed = await web.database.read(study_openings.closed)
    names = (name for name in web.studies.names() if name not in closed)
    open_studies = [found[1] for name in names if (found := web.studies.open(name))]
    studies = [(study, _kitchens(study)) for study in open_studies]
    rounds = {study.name: episodes_of(study) for study in open_studies}
    return page(request, web).render("participant/choose.html", studies=studies, rounds=rounds)


def _kitchens(study: Study) -> list[tuple[Text, list[str]]]:
    """Return titles and grids of the first kitchens, for their pictures."""
    shown = study.layouts[:MAX_PICTURES] if "episodes" in study.flow else []
    return [(kitchen.title, layout_of(kitchen).text.splitlines()) for kitchen in shown]


@router.get("/s/{name}/new")
async def new_page(request: Request, known: KnownStudyDep, web: WebDep, participant: ParticipantDep) -> Response:
    """Ask whether somebody else wants to take part in this browser."""
    if participant is None or not may_start_new(known.study):
        return see_other(f"/s/{known.study.name}")
    made = page(request, web, known.study, participant)
    return next_person(made, participant)


@router.post("/s/{name}/new")
async def start_new(known: KnownStudyDep, web: WebDep, form: FormDep) -> Response:  # noqa: ARG001 - checks the form
    """Delete the cookie and the pages' stored data in this browser, so that the next person can begin."""
    response = see_other(f"/s/{known.study.name}")
    if may_start_new(known.study):
        forget_cookie(response, known.study.name, secure=web.csrf.secure)
        response.headers["Clear-Site-Data"] = '"storage"'
    return response


@router.websocket("/s/{name}/check")
async def check_connection(socket: WebSocket, name: str, web: WebDep) -> None:
    """Echo a few messages, with which the entry check measures the connection."""
    if web.studies.open(name) is None or not web.csrf.is_own_origin(socket):
        await socket.close(CloseCode.REFUSED)
        return
    await socket.accept()
    code = CloseCode.FINISHED
    try:
        async with asyncio.timeout(CHECK_S):
            for _ in range(MAX_ECHOES):
                words = await socket.receive_text()
                await socket.send_text(words[:ECHOED_CHARACTERS])
    except KeyError:
        code = CloseCode.NOT_TEXT  # a binary frame
    except (TimeoutError, WebSocketDisconnect, RuntimeError):
        pass
    with contextlib.suppress(RuntimeError, WebSocketDisconnect):
        await socket.close(code)


@router.get("/s/{name}/now")
async def now(request: Request, name: str, web: WebDep, participant: ParticipantDep) -> Response:
    """Show the current step, whatever page was open before."""
    if participant is None:
        return see_other(f"/s/{name}")
    here = await web.database.write(progress.arrive, web.studies, participant.id)
    if here is None:
        return see_other(f"/s/{name}")
    return await _show(request, web, here)


@router.post("/s/{name}/now")
async def submit(
    request: Request, name: str, web: WebDep, participant: ParticipantDep, sent: AnswersFormDep
) -> Response:
    """Handle the submission of the current step's page. That of any other step changes nothing and leads to the current
    one."""
    if participant is None:
        return see_other(f"/s/{name}")
    back, form = see_other(step_address(name)), sent.form
    step = web.studies.step(participant)
    if participant.status != "active" or first(form, "step") != step.key:
        return back
    if sent.expired is not None:
        return await _show(request, web, participant, Filled(form, expired=True), 403)
    study = web.studies.of(participant)
    earlier = await web.studies.earlier_answers(web.database, participant) or {}
    checked, attention = check_page(study, participant, step, form, earlier)
    if checked.faults:
        if any(fault.reason == "wrong" for fault in checked.faults.values()):
            failed = progress.FailedQuiz(_attempt(form), {key: checked.answers.get(key) for key in checked.faults})
            if not await web.database.write(progress.wrong_quiz, web.studies, participant.id, failed):
                return back
        return await _show(request, web, participant, Filled(form, checked.faults), 422)
    submission = progress.Submission(step, checked.answers, attention, _attempt(form))
    await web.database.write(progress.submit, web.studies, participant.id, submission)
    return back


def _attempt(form: Form) -> int:
    """Return the number that the quiz's page carried; 0, which no attempt has, for anything else."""
    text = first(form, "attempt")
    return int(text) if text.isascii() and text.isdigit() and len(text) < 6 else 0


async def _show(
    request: Request, web: Web, participant: Participant, filled: Filled | None = None, status: int = 200
) -> Response:
    made = page(request, web, web.studies.of(participant), participant)
    return await render_step(made, participant, filled, status)


@router.post("/s/{name}/language")
async def language(name: str, web: WebDep, participant: ParticipantDep, form: FormDep) -> Response:
    """Set the language of the pages."""
    choice = first(form, "language")
    if participant is not None and choice in web.studies.of(participant).languages:
        await web.database.write(participants.set_language, participant.id, choice)
    return see_other(step_address(name))
