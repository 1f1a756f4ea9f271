"""Routes of the consent page: who gets it, who gets in, and what the others are told. A GET stores nothing."""

import secrets
from collections.abc import Mapping
from dataclasses import replace
from datetime import UTC, datetime

from fastapi import APIRouter, HTTPException, Request, Response
from fastapi.responses import RedirectResponse

from server.participation import progress
from server.participation.recruiter_links import is_preview, link_parameters, may_start_new, recruitment_of, turned_away
from server.store import enrolment_limits, study_openings
from server.store.enrolment_limits import EnrolmentLimitReached
from server.store.participants import Participant
from server.store.study_openings import StudyClosed
from server.study.assignment import StudyFullError
from server.study.definition import Study
from server.study.recruitment import Recruitment
from server.study.steps import step_address
from server.web.auth import BOT_MARK, is_bot_mark, set_cookie, token_for, token_of
from server.web.client_address import address_of
from server.web.dependencies import ConsentFormDep, KnownStudyDep, PageResponse, ParticipantDep, Web, WebDep, page
from server.web.forms import Form, first
from server.web.participant.views import consent_again, consent_context

router = APIRouter()
SEE_OTHER = 303


def see_other(path: str) -> RedirectResponse:
    return RedirectResponse(path, SEE_OTHER, {"Cache-Control": "no-store"})


@router.get("/s/{name}")
async def consent_page(request: Request, known: KnownStudyDep, web: WebDep, participant: ParticipantDep) -> Response:
    """Show the consent page; a participant of the study continues instead. Nothing is stored, so link previews are
    safe."""
    study, made = known.study, page(request, web, known.study)
    person, extra = recruitment_of(study.recruitment, dict(request.query_params))
    before = await web.database.read(progress.known, web.studies, study.name, person) if person else None
    if participant is not None and (shown := await _continues(made, participant, (person, extra), before)):
        return shown
    if shown := _in_mturk(made, study):
        return shown
    # Their link names everybody: with a cookie that no longer counts, this is not a new participant.
    is_over = participant is None and person is None and not may_start_new(study) and token_of(request) is not None
    if person is None and study.recruitment.required:
        return made.render("participant/link_needed.html", 400, is_over=is_over)
    if before is not None and before.status != "active" and (participant is None or participant.id != before.id):
        return made.render("participant/finished.html")
    if before is None and (not known.is_open or study.name in await web.database.read(study_openings.closed)):
        return _no_place(made, "closed", person, extra)
    if before is None and await web.database.read(progress.is_paused, study.name):
        return _paused(made)
    context = consent_context(study, made.language, person, extra, secrets.token_urlsafe(24))
    context["notice"] = "session_over" if is_over else ""
    template = "participant/welcome_back.html" if before is not None else "participant/consent.html"
    return made.render(template, **context)


async def _continues(
    made: PageResponse, participant: Participant, link: tuple[str | None, dict[str, str]], before: Participant | None
) -> Response | None:
    """Return where somebody continues who takes part in this browser already. None: the link is another person's, or
    tells something new. `before`: the participant whom the link names."""
    (person, extra), web = link, made.web
    assert made.study is not None  # noqa: S101 - the caller's page is one of a study
    if person is not None and (before is None or before.id != participant.id):
        return None
    if may_start_new(made.study) and participant.status != "active":
        return next_person(made, participant)
    if person is None or not await web.database.read(progress.has_news, participant.id, extra):
        return see_other(step_address(made.study.name))
    return None


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
    request: Request, known: KnownStudyDep, web: WebDep, participant: ParticipantDep, sent: ConsentFormDep
) -> Response:
    """Make the participant and the cookie. The same page sent twice makes one participant."""
    study, form = known.study, sent.form
    person, extra = recruitment_of(study.recruitment, {key: values[0] for key, values in form.items()})
    request.state.link = link_parameters(study.recruitment, person, extra)  # also for the page of an error
    if person is None and study.recruitment.required:
        raise sent.expired or HTTPException(400, "the link's parameter that names the person is missing")
    made = _in_language(page(request, web, study), first(form, "language"))
    made = replace(made, link=request.state.link)
    visit = first(form, "visit")
    if not 16 <= len(visit) <= 64:
        raise sent.expired or HTTPException(400, "The form has no valid number. Reload the page.")
    token = token_for(web.csrf.secret, study.name, visit)
    holder = participant.id if participant is not None else None
    simulated = _is_simulated(web, form)
    read = first(form, "consent_text")
    arrival = progress.ConsentArrival(study.name, token, made.language, person, extra, simulated, holder, read)
    before = await web.database.read(progress.already_here, web.studies, arrival)
    open_boxes = [index for index in range(len(study.consent.boxes)) if not first(form, f"box_{index}")]
    if sent.expired is not None:
        return await _expired(made, participant, arrival, before, (visit, open_boxes))
    if open_boxes and before is None:
        return consent_again(made, arrival, visit, open_boxes)
    try:
        refused = await _enrol(made, arrival)
    except progress.ConsentChanged:
        opened = web.studies.open(study.name)
        return consent_again(replace(made, study=opened[1] if opened else study), arrival, visit, [])
    if refused is not None:
        return refused
    response = see_other(step_address(study.name))
    set_cookie(response, study.name, token, secure=web.csrf.secure)
    return response


async def _expired(
    made: PageResponse,
    participant: Participant | None,
    arrival: progress.ConsentArrival,
    before: Participant | None,
    sent: tuple[str, list[int]],
) -> Response:
    """Show a page again that was open for too long, or since before another tab of this browser consented. Nothing
    that it sent counts, but it keeps the ticked boxes and the recruiter's parameters. `sent`: visit, open boxes."""
    link = (arrival.person, dict(arrival.extra))
    if participant is not None and (shown := await _continues(made, participant, link, before)):
        return shown
    if before is None:
        return consent_again(made, arrival, *sent, expired=True)
    assert made.study is not None  # noqa: S101 - as above
    context = consent_context(made.study, made.language, arrival.person, arrival.extra, sent[0])
    return made.render("participant/welcome_back.html", 403, **context)


def _is_simulated(web: Web, form: Form) -> bool:
    """Return whether a bot consents. On a public server it must prove that with the server's secret."""
    if first(form, "simulated") != "yes":
        return False
    return not web.production or is_bot_mark(web.csrf.secret, first(form, "visit"), first(form, BOT_MARK))


async def _enrol(made: PageResponse, arrival: progress.ConsentArrival) -> Response | None:
    """Enrol the participant, or return the page with the reason why not."""
    web = made.web
    limits = [] if arrival.simulated else web.enrolment_limits.limits_of(address_of(made.request))
    try:
        await web.database.write(progress.enrol_within, web.studies, arrival, limits)
    except EnrolmentLimitReached:
        await web.database.write(enrolment_limits.turn_away, arrival.study, datetime.now(UTC))
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


def next_person(made: PageResponse, participant: Participant) -> Response:
    """Show the page for the next person. Only somebody with a code is offered to see it: a place may have been released
    without one."""
    ended = "finished" if participant.completion_code else "ended"
    return made.render("participant/next_person.html", state="active" if participant.status == "active" else ended)
