"""The routes of a participant, thin: read the request, ask walk.py, render. A GET notes a visit and changes no more."""

import asyncio
import contextlib
import secrets

from fastapi import APIRouter, HTTPException, Request, Response, WebSocket, WebSocketDisconnect
from fastapi.responses import RedirectResponse

from server.store import participants
from server.store.participants import Participant
from server.study.assignment import StudyFullError
from server.study.plan import Study
from server.study.questionnaire import Checked, Fault, asked, check_answers, is_attentive, is_correct
from server.study.steps import Step
from server.web import arrivals, walk
from server.web.auth import set_cookie, token_for
from server.web.deps import ConsentFormDep, FormDep, OpenStudyDep, Page, ParticipantDep, Web, WebDep, page
from server.web.forms import Form, first
from server.web.recruiting import is_preview, recruitment_of
from server.web.views import Filled, consent_context, render_step

router = APIRouter()
router.include_router(arrivals.router)
SEE_OTHER = 303
CHECK_S = 15
MOST_ECHOES = 20
ECHOED_CHARACTERS = 16


def _to(path: str) -> RedirectResponse:
    return RedirectResponse(path, SEE_OTHER, {"Cache-Control": "no-store"})


@router.get("/")
async def choose(request: Request, web: WebDep) -> Response:
    """Which study to take part in."""
    studies = [study for name in web.studies.names() if (found := web.studies.open(name)) for study in [found[1]]]
    return page(request, web).render("participant/choose.html", studies=studies)


@router.get("/s/{name}")
async def consent_page(request: Request, opened: OpenStudyDep, web: WebDep, participant: ParticipantDep) -> Response:
    """The consent page; whoever is in the study already goes on. Stores nothing, so a link preview burns nothing."""
    study = opened.study
    person, extra = recruitment_of(study.recruitment, dict(request.query_params))
    before = await web.database.read(walk.known, web.studies, study.name, person) if person else None
    if participant is not None and (person is None or (before is not None and before.id == participant.id)):
        return _to(f"/s/{study.name}/now")
    made = page(request, web, study)
    if shown := _in_mturk(made, study):
        return shown
    if person is None and study.recruitment.required:
        return made.render("participant/link_needed.html", 400)
    if before is None and await web.database.read(walk.is_paused, study.name):
        return _paused(made)
    context = consent_context(study, made.language, person, extra, secrets.token_urlsafe(24))
    template = "participant/welcome_back.html" if before is not None else "participant/consent.html"
    return made.render(template, **context)


def _paused(made: Page) -> Response:
    response = made.render("participant/paused.html", 503)
    response.headers["Retry-After"] = "60"
    return response


def _in_mturk(made: Page, study: Study) -> Response | None:
    """MTurk shows a study in a frame, where browsers keep no cookies and a game is too small: it opens in a tab."""
    preview = is_preview(study.recruitment, made.request.query_params)
    framed = made.request.headers.get("sec-fetch-dest") in ("iframe", "frame")
    if study.recruitment.source != "mturk" or not (preview or framed):
        return None
    response = made.render("participant/open.html", preview=preview)
    made.allow(response, framed_by="https://*.mturk.com")
    return response


@router.post("/s/{name}/consent")
async def consent(request: Request, opened: OpenStudyDep, web: WebDep, form: ConsentFormDep) -> Response:
    """Makes the participant and the cookie. The same page sent twice makes one participant."""
    study = opened.study
    person, extra = recruitment_of(study.recruitment, {key: values[0] for key, values in form.items()})
    if person is None and study.recruitment.required:
        raise HTTPException(400, "the link's parameter that names the person is missing")
    made = page(request, web, study)
    language = first(form, "language")
    if language in study.languages:
        made = type(made)(request, web, language, study)
    visit = first(form, "visit")
    if not 16 <= len(visit) <= 64:
        raise HTTPException(400, "the form lacks its number")
    token = token_for(web.guard.secret, study.name, visit)
    known = await web.database.read(walk.known, web.studies, study.name, person)
    open_boxes = [index for index in range(len(study.consent.boxes)) if not first(form, f"box_{index}")]
    if open_boxes and known is None:
        context = consent_context(study, made.language, person, extra, visit)
        ticked = [index for index in range(len(study.consent.boxes)) if index not in open_boxes]
        return made.render("participant/consent.html", 422, **(context | {"ticked": ticked, "open_boxes": open_boxes}))
    arrival = walk.Arrival(study.name, token, made.language, person, extra, first(form, "simulated") == "yes")
    try:
        await web.database.write(walk.enrol, web.studies, arrival)
    except walk.StudyPaused:
        return _paused(made)
    except StudyFullError:
        return made.render("participant/full.html", 409)
    response = _to(f"/s/{study.name}/now")
    set_cookie(response, study.name, token, secure=web.guard.secure)
    return response


@router.websocket("/s/{name}/check")
async def check_connection(socket: WebSocket, name: str) -> None:
    """Sends back what comes, a few times: the entry check measures the connection with it."""
    web: Web = socket.app.state.web
    if web.studies.open(name) is None or not web.guard.is_own_origin(socket):
        await socket.close(1008)
        return
    await socket.accept()
    code = 1000
    try:
        async with asyncio.timeout(CHECK_S):
            for _ in range(MOST_ECHOES):
                words = await socket.receive_text()
                await socket.send_text(words[:ECHOED_CHARACTERS])
    except KeyError:
        code = 1003  # a binary frame
    except (TimeoutError, WebSocketDisconnect, RuntimeError):
        pass
    with contextlib.suppress(RuntimeError):
        await socket.close(code)


@router.get("/s/{name}/now")
async def now(request: Request, name: str, web: WebDep, participant: ParticipantDep) -> Response:
    """The current step, whatever page was open before."""
    if participant is None:
        return _to(f"/s/{name}")
    here = await web.database.write(walk.arrive, web.studies, participant.id)
    if here is None:
        return _to(f"/s/{name}")
    return await _show(request, web, here)


@router.post("/s/{name}/now")
async def submit(request: Request, name: str, web: WebDep, participant: ParticipantDep, form: FormDep) -> Response:
    """Takes the current step's page. One that is not current changes nothing and leads to the one that is."""
    if participant is None:
        return _to(f"/s/{name}")
    back = _to(f"/s/{name}/now")
    step = web.studies.step(participant)
    if participant.status != "active" or first(form, "step") != step.key:
        return back
    study = web.studies.of(participant)
    checked, happened = _check(study, participant, step, form)
    if checked.faults:
        if any(fault.reason == "wrong" for fault in checked.faults.values()):
            wrong = {key: checked.answers.get(key) for key in checked.faults}
            attempts = study.quiz.attempts if study.quiz else None
            after = await web.database.write(walk.wrong_quiz, participant.id, wrong, attempts)
            if after is None or after.status != "active":
                return back
        return await _show(request, web, participant, Filled(form, checked.faults), 422)
    submission = walk.Submission(step, checked.answers, happened)
    await web.database.write(walk.submit, web.studies, participant.id, submission)
    return back


def _check(
    study: Study, participant: Participant, step: Step, form: Form
) -> tuple[Checked, dict[str, dict[str, object]]]:
    """The answers of a page with questions, and what is to be noted about them."""
    if step.kind not in ("questionnaire", "quiz"):
        return Checked({}, {}), {}
    condition = study.condition(participant.condition)
    questions = asked(study.questions(step.page or step.kind), condition.name, condition.shows_predictions)
    checked = check_answers(questions, form)
    failed = [
        question.key for question in questions if is_attentive(question, checked.answers.get(question.key)) is False
    ]
    happened: dict[str, dict[str, object]] = (
        {"attention_failed": {"step": step.key, "questions": failed}} if failed else {}
    )
    if step.kind == "quiz" and not checked.faults:
        wrong = {q.key: Fault("wrong", {}) for q in questions if not is_correct(q, checked.answers.get(q.key))}
        checked = Checked(checked.answers, wrong)
    return checked, happened


async def _show(
    request: Request, web: Web, participant: Participant, filled: Filled | None = None, status: int = 200
) -> Response:
    made = page(request, web, web.studies.of(participant), participant)
    return await render_step(made, participant, filled, status)


@router.post("/s/{name}/language")
async def language(name: str, web: WebDep, participant: ParticipantDep, form: FormDep) -> Response:
    """The language of the pages from now on."""
    wish = first(form, "language")
    if participant is not None and wish in web.studies.of(participant).languages:
        await web.database.write(participants.set_language, participant.id, wish)
    return _to(f"/s/{name}/now")
