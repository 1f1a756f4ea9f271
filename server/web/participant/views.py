"""The data for the template of each step. Read-only; the progress of participants is decided elsewhere."""

from collections.abc import Awaitable, Callable, Mapping
from dataclasses import dataclass, field
from typing import Any, Final

from fastapi import Response

from server.participation import pairing, progress
from server.participation.episode_specs import layout_of, lessons
from server.participation.page_answers import questions_of
from server.participation.recruiter_links import ReturnTarget, link_parameters, return_target
from server.store import episodes, events, participants
from server.store.participants import Participant
from server.store.tables import RECRUITMENT_ID
from server.study.answer_checks import AnswerError
from server.study.consent import Section
from server.study.definition import Study
from server.study.recruitment import Exit
from server.study.steps import PHASES, Kind, StudyStep, episodes_of
from server.web.dependencies import PageResponse
from server.web.participant.introduction import introduction_of


@dataclass(frozen=True)
class Filled:
    """A form that is shown again with its values: answers are invalid, or the page was open for too long."""

    form: Mapping[str, list[str]] = field(default_factory=dict)
    faults: Mapping[str, AnswerError] = field(default_factory=dict)
    expired: bool = False


async def render_step(page: PageResponse, participant: Participant, filled: Filled | None, status: int) -> Response:
    """Render the participant's current page."""
    if participant.status not in ("active", "completed"):
        kind, outcome = await _ended(page, participant)
        words: dict[str, Any] = {"kind": kind, "outcome": outcome, "debriefing": debriefing_of(page, participant)}
        return page.render("participant/ended.html", **words, back=await _back(page, outcome))
    sequence = page.web.studies.steps_of(participant)
    step = page.web.studies.step(participant)
    shown = {one.phase for one in sequence} | {"consent"}
    base: dict[str, Any] = {
        "step": step,
        "phases": [phase for phase in PHASES if phase in shown],
        "phase": step.phase,
        "episodes": episodes_of(page.web.studies.of(participant)),
    }
    template, context_of = STEP_PAGES[step.kind]
    filled = filled or Filled()
    base |= {"expired": filled.expired} | await context_of(page, participant, step, filled)
    response = page.render(f"participant/{template}.html", status, **base)
    back = base.get("back")
    if back is not None and back.fields is not None:
        page.allow(response, form_to=back.origin)
    return response


def consent_context(
    study: Study, language: str, person: str | None, extra: Mapping[str, str], visit: str
) -> dict[str, Any]:
    """Return the data of the consent page. Its form carries the link's parameters, which are not in the address of
    later pages."""
    phases = ["consent", "introduction", "practice", "rounds", "finish"]
    present = {"consent", "introduction", "finish"}
    present |= {"practice"} if "tutorial" in study.flow else set()
    present |= {"rounds"} if "episodes" in study.flow else set()
    return {
        "consent": study.consent,
        "kept": link_parameters(study.recruitment, person, extra),
        "visit": visit,
        "consent_text": study.consent.fingerprint,
        "notice": "",
        "ticked": [],
        "open_boxes": [],
        "phases": [phase for phase in phases if phase in present],
        "phase": "consent",
        "page_language": language,
    }


def consent_again(
    made: PageResponse, arrival: progress.ConsentArrival, visit: str, open_boxes: list[int], expired: bool = False
) -> Response:
    """Show the consent page again: with a new text, for which no box is ticked; because of boxes that are open; or
    because the form had expired."""
    assert made.study is not None  # noqa: S101 - the caller's page is one of a study
    consent = made.study.consent
    changed = arrival.text not in ("", consent.fingerprint)
    context = consent_context(made.study, made.language, arrival.person, arrival.extra, visit)
    if changed:
        return made.render("participant/consent.html", 409, **context | {"notice": "changed"})
    ticked = [index for index in range(len(consent.boxes)) if index not in open_boxes]
    context |= {"ticked": ticked, "open_boxes": open_boxes, "notice": "expired" if expired else ""}
    return made.render("participant/consent.html", 403 if expired else 422, **context)


async def _ended(page: PageResponse, participant: Participant) -> tuple[str, Exit]:
    """Return how the participation ended early, and the code that the person gets."""
    study = page.web.studies.of(participant)
    if participant.status == "returned" and participant.completion_code:
        unpaired = study.recruitment.unpaired
        return "unpaired", unpaired.model_copy(update={"code": unpaired.code or participant.completion_code})
    if participant.status == "screened_out":
        database, kind = page.web.database, events.ATTENTION_SCREENED_OUT
        inattentive = await database.read(events.of_participant, participant.id, kind)
        return ("inattentive" if inattentive else "screened_out"), study.recruitment.screened_out
    return ("withdrawn" if participant.status == "withdrawn" else "timed_out"), Exit()


def debriefing_of(page: PageResponse, participant: Participant) -> Section | None:
    """Return the debriefing of somebody who leaves early and whose condition may have misled them."""
    study = page.web.studies.version(participant.study_id)
    if study is None:  # it can no longer be read
        return None
    misled = study.condition(participant.condition).misleads
    return study.pages[study.debriefing] if misled and study.debriefing else None


async def _back(page: PageResponse, outcome: Exit, code: str = "") -> ReturnTarget | None:
    participant = page.participant
    if participant is None:
        return None
    kept = await page.web.database.read(participants.personal_of, participant.id)
    person = kept.pop(RECRUITMENT_ID, "")
    values = {name: value for name, value in (("person", person), ("code", outcome.code or code)) if value}
    return return_target(page.web.studies.of(participant).recruitment, outcome, kept | values)


async def _questions(page: PageResponse, participant: Participant, step: StudyStep, filled: Filled) -> dict[str, Any]:
    study = page.web.studies.of(participant)
    earlier = await page.web.studies.earlier_answers(page.web.database, participant)
    questionnaire = study.quiz if step.kind == "quiz" and study.quiz else study.questionnaires[step.asks]
    messages = {name: _message(page, study, name, fault) for name, fault in filled.faults.items()}
    # Somebody whose connection was away when the round was stopped sees only this page.
    before = await page.web.database.read(progress.last_episode, participant.id, step.number + 1)
    return {
        "stopped": step.number > 0 and before is not None and before.status == "aborted",
        "questionnaire": questionnaire,
        "questions": questions_of(study, participant, step, earlier),
        "form": filled.form,
        "faults": messages,
        "attempts": None,
    }


async def _quiz(page: PageResponse, participant: Participant, step: StudyStep, filled: Filled) -> dict[str, Any]:
    quiz = page.web.studies.of(participant).quiz
    attempt = await page.web.database.read(progress.quiz_attempt, participant.id)
    shown = await _questions(page, participant, step, filled)
    return shown | {"attempt": attempt, "attempts": quiz.attempts if quiz else None}


def _message(page: PageResponse, study: Study, name: str, fault: AnswerError) -> str:
    if fault.reason != "wrong":
        return page.words(f"faults.{fault.reason}", **fault.numbers)
    question = next((one for one in study.quiz.asks if one.key == name), None) if study.quiz else None
    explanation = getattr(question, "explanation", None)
    return explanation.of(page.language) if explanation else page.words("quiz.wrong_answer")


async def _introduction(
    page: PageResponse, participant: Participant, _step: StudyStep, _filled: Filled
) -> dict[str, Any]:
    study = page.web.studies.of(participant)
    return {"introduction": introduction_of(study, study.condition(participant.condition), page.words)}


async def _ready(page: PageResponse, participant: Participant, step: StudyStep, _filled: Filled) -> dict[str, Any]:
    study = page.web.studies.of(participant)
    kitchen = study.layout(step.layout)
    last = await page.web.database.read(progress.last_episode, participant.id, step.number)
    mates = await page.web.database.read(pairing.company, page.web.studies, participant, step)
    return {
        "with_human": study.agent(step.agent).human and not mates.alone,
        "kitchen": kitchen.title.of(page.language),
        "grid": layout_of(kitchen).grid,
        "seconds": round(study.game.horizon * study.game.tick_ms / 1000),
        "last": last,
        "last_kitchen": _title(study, last, page.language),
    }


def _title(study: Study, episode: "episodes.StoredEpisode | None", language: str) -> str:
    titles = {kitchen.name: kitchen.title.of(language) for kitchen in study.layouts}
    return titles.get(episode.layout, episode.layout) if episode else ""


async def _thanks(page: PageResponse, participant: Participant, _step: StudyStep, _filled: Filled) -> dict[str, Any]:
    """Return the last page. The code is shown only after it is stored."""
    study = page.web.studies.of(participant)
    completed = study.recruitment.completed
    own = participant.completion_code or ""
    return {
        "code": completed.code or own,
        "own_code": own,
        "back": await _back(page, completed, own),
        "recruited": study.recruitment.source != "none",
    }


async def _game(page: PageResponse, participant: Participant, step: StudyStep, _filled: Filled) -> dict[str, Any]:
    study = page.web.studies.of(participant)
    taught = lessons(study, study.condition(participant.condition)) if step.kind == "tutorial" else ()
    game = {
        "socket": f"/s/{study.name}/socket",
        "leave": f"/s/{study.name}/withdraw",
        "lessons": taught,
        "away_s": study.game.pause.each_s,
    }
    skip = step.key if step.kind == "tutorial" and study.tutorial.skippable else None
    rounds = await _earlier_rounds(page, participant) if step.kind == "episode" else []
    # A round of two has one specification, in the language of one of them: each page names the kitchen in its own.
    title = study.layout(step.layout).title.of(page.language) if step.kind == "episode" else ""
    expects = await page.web.database.read(pairing.expects_partner, page.web.studies, participant, step)
    game |= {"skip": skip, "rounds": rounds, "title": title, "expects_partner": expects}
    return {"game": game | {"ready_page": step.kind == "episode"}}


async def _earlier_rounds(page: PageResponse, participant: Participant) -> list[dict[str, int | None]]:
    """Return number and points of each round that the participant has played to its end, for the curve on the
    result."""
    played = await page.web.database.read(episodes.of_participant, participant.id)
    return [
        {"number": one.number, "score": one.score} for one in played if one.kind == "episode" and one.status == "done"
    ]


async def _text(_page: PageResponse, _participant: Participant, _step: StudyStep, _filled: Filled) -> dict[str, Any]:
    """Return a page whose texts are all in the study file."""
    return {}


Context = Callable[[PageResponse, Participant, StudyStep, Filled], Awaitable[dict[str, Any]]]
# The page of each kind of step: its template in templates/participant, and what the template needs.
STEP_PAGES: Final[Mapping[Kind, tuple[str, Context]]] = {
    "introduction": ("introduction", _introduction),
    "quiz": ("questionnaire", _quiz),
    "questionnaire": ("questionnaire", _questions),
    "page": ("page", _text),
    "tutorial": ("game", _game),
    "ready": ("ready", _ready),
    "episode": ("game", _game),
    "break": ("break", _text),
    "thanks": ("thanks", _thanks),
}
