"""Routes of a participant: read the request, ask `participation.progress`, render. A GET only records a visit."""

import asyncio
import contextlib
import secrets
from collections.abc import Mapping
from dataclasses import replace
from datetime import UTC, datetime

from fastapi import APIRouter, HTTPException, Request, Response, WebSocket, WebSocketDisconnect
from fastapi.responses import RedirectResponse

from server.participation import progress
from server.participation.episode_specs import layout_of
from server.participation.page_answers import check_page
from server.participation.recruiter_links import is_preview, link_parameters, may_start_new, recruitment_of, turned_away
from server.play.close_codes import CloseCode
from server.store import new_places, participants, study_openings
from server.store.new_places import NoPlaceLeft
from server.store.participants import Participant
from server.store.study_openings import StudyClosed
from server.study.assignment import StudyFullError
from server.study.definition import Study
from server.study.recruitment import Recruitment
from server.study.steps import episodes_of, step_address
from server.study.text import Text
from server.web.auth import BOT_MARK, forget_cookie, is_bot_mark, set_cookie, token_for
from server.web.client_address import address_of
from server.web.dependencies import (
    AnswersFormDep,
    ConsentFormDep,
    FormDep,
    KnownStudyDep,
    PageResponse,
    ParticipantDep,
    Web,
    WebDep,
    page,
)
from server.web.forms import Form, first
from server.web.participant import visit_counts
from server.web.participant.views import Filled, consent_again, consent_context, render_step

router = APIRouter()
router.include_router(visit_counts.router)
SEE_OTHER = 303
MAX_PICTURES = 5  # of kitchens of one study
CHECK_S = 15
MAX_ECHOES = 20
ECHOED_CHARACTERS = 16


def _to(path: str) -> RedirectResponse:
    return RedirectResponse(path, SEE_OTHER, {"Cache-Control": "no-store"})


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


@router.get("/s/{name}")
async def consent_page(request: Request, known: KnownStudyDep, web: WebDep, participant: ParticipantDep) -> Response:
    """Show the consent page; a participant of the study continues instead. Nothing is stored, so link previews are
    safe."""
    study, made = known.study, page(request, web, known.study)
    person, extra = recruitment_of(study.recruitment, dict(request.query_params))
    before = await web.database.read(progress.known, web.studies, study.name, person) if person else None
    if participant is not None and (person is None or (before is not None and before.id == participant.id)):
        if may_start_new(study) and participant.status != "active":
            return _next_person(made, participant)
        if person is None or not await web.database.read(progress.has_news, participant.id, extra):
            return _to(step_address(study.name))
    if shown := _in_mturk(made, study):
        return shown
    if person is None and study.recruitment.required:
        return made.render("participant/link_needed.html", 400)
    if before is not None and before.status != "active" and (participant is None or participant.id != before.id):
        return made.render("participant/finished.html")
    if before is None and (not known.is_open or study.name in await web.database.read(study_openings.closed)):
        return _no_place(made, "closed", person, extra)
    if before is None and await web.database.read(progress.is_paused, study.name):
        return _paused(made)
    context = consent_context(study, made.language, person, extra, secrets.token_urlsafe(24))
    template = "participant/welcome_back.html" if before is not None else "participant/consent.html"
    return made.render(template, **context)


def _paused(made: PageResponse) -> Response:
    response = made.render("participant/paused.html", 503)
    response.headers["Retry-After"] = "60"
    return response


def _in_mturk(made: PageResponse, study: Study) -> Response | None:
    """Return a page that opens the study in a tab if MTurk shows it in a frame, where browsers keep no cookies and a
    game is too small; otherwise None."""
    preview = is_preview(study.recruitment, made.request.query_params)
    framed = made.request.headers.get("sec-fetch-dest") in ("iframe", "frame")
    if study.recruitment.source != "mturk" or not (preview or framed):
        return None
    response = made.render("participant/open.html", preview=preview)
    made.allow(response, framed_by="https://*.mturk.com")
    return response


@router.post("/s/{name}/consent")
async def consent(
    request: Request, known: KnownStudyDep, web: WebDep, participant: ParticipantDep, form: ConsentFormDep
) -> Response:
    """Make the participant and the cookie. The same page sent twice makes one participant."""
    study = known.study
    person, extra = recruitment_of(study.recruitment, {key: values[0] for key, values in form.items()})
    request.state.link = link_parameters(study.recruitment, person, extra)  # also for the page of an error
    if person is None and study.recruitment.required:
        raise HTTPException(400, "the link's parameter that names the person is missing")
    made = _in_language(page(request, web, study), first(form, "language"))
    made = replace(made, link=request.state.link)
    visit = first(form, "visit")
    if not 16 <= len(visit) <= 64:
        raise HTTPException(400, "The form has no valid number. Reload the page.")
    token = token_for(web.csrf.secret, study.name, visit)
    holder = participant.id if participant is not None else None
    simulated = _is_simulated(web, form)
    read = first(form, "consent_text")
    arrival = progress.ConsentArrival(study.name, token, made.language, person, extra, simulated, holder, read)
    before = await web.database.read(progress.already_here, web.studies, arrival)
    open_boxes = [index for index in range(len(study.consent.boxes)) if not first(form, f"box_{index}")]
    if open_boxes and before is None:
        return consent_again(made, arrival, visit, open_boxes)
    try:
        refused = await _enrol(made, arrival)
    except progress.ConsentChanged:
        opened = web.studies.open(study.name)
        return consent_again(replace(made, study=opened[1] if opened else study), arrival, visit, [])
    if refused is not None:
        return refused
    response = _to(step_address(study.name))
    set_cookie(response, study.name, token, secure=web.csrf.secure)
    return response


def _is_simulated(web: Web, form: Form) -> bool:
    """Return whether a bot consents. On a public server it must prove that with the server's secret."""
    if first(form, "simulated") != "yes":
        return False
    return not web.production or is_bot_mark(web.csrf.secret, first(form, "visit"), first(form, BOT_MARK))


async def _enrol(made: PageResponse, arrival: progress.ConsentArrival) -> Response | None:
    """Enrol the participant, or return the page with the reason why not."""
    web = made.web
    budgets = [] if arrival.simulated else web.places.budgets_of(address_of(made.request))
    try:
        await web.database.write(progress.enrol_within, web.studies, arrival, budgets)
    except NoPlaceLeft:
        await web.database.write(new_places.turn_away, arrival.study, datetime.now(UTC))
        response = made.render("participant/crowded.html", 429)
        response.headers["Retry-After"] = "3600"
        return response
    except progress.StudyPaused:
        return _paused(made)
    except progress.AlreadyFinished:
        return made.render("participant/finished.html", 409)
    except StudyFullError:
        return _no_place(made, "full", arrival.person, arrival.extra)
    except StudyClosed:
        return _no_place(made, "closed", arrival.person, arrival.extra)
    return None


def _no_place(made: PageResponse, template: str, person: str | None, extra: Mapping[str, str]) -> Response:
    """Tell somebody whom a recruiter still sent how to go back, as if they had declined: nothing is stored."""
    recruitment = made.study.recruitment if made.study is not None else Recruitment()
    return made.render(
        f"participant/{template}.html", 409, **turned_away(recruitment, recruitment.declined, person, extra)
    )


def _in_language(made: PageResponse, choice: str) -> PageResponse:
    return replace(made, language=choice) if choice in made.languages else made


@router.get("/s/{name}/new")
async def new_page(request: Request, known: KnownStudyDep, web: WebDep, participant: ParticipantDep) -> Response:
    """Ask whether somebody else wants to take part in this browser."""
    if participant is None or not may_start_new(known.study):
        return _to(f"/s/{known.study.name}")
    made = page(request, web, known.study, participant)
    return _next_person(made, participant)


def _next_person(made: PageResponse, participant: Participant) -> Response:
    """Show the page for the next person. Only somebody with a code is offered to see it: a place may have been released
    without one."""
    ended = "finished" if participant.completion_code else "ended"
    return made.render("participant/next_person.html", state="active" if participant.status == "active" else ended)


@router.post("/s/{name}/new")
async def start_new(known: KnownStudyDep, web: WebDep, form: FormDep) -> Response:  # noqa: ARG001 - checks the form
    """Delete the cookie and the pages' stored data in this browser, so that the next person can begin."""
    response = _to(f"/s/{known.study.name}")
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
        return _to(f"/s/{name}")
    here = await web.database.write(progress.arrive, web.studies, participant.id)
    if here is None:
        return _to(f"/s/{name}")
    return await _show(request, web, here)


@router.post("/s/{name}/now")
async def submit(
    request: Request, name: str, web: WebDep, participant: ParticipantDep, form: AnswersFormDep
) -> Response:
    """Handle the submission of the current step's page. That of any other step changes nothing and leads to the current
    one."""
    if participant is None:
        return _to(f"/s/{name}")
    back = _to(step_address(name))
    step = web.studies.step(participant)
    if participant.status != "active" or first(form, "step") != step.key:
        return back
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
    return _to(step_address(name))
