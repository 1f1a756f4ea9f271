"""How a participant moves through a study, as functions on one database transaction.

Every function is idempotent, and a call that comes too late changes nothing."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from datetime import UTC, datetime
from typing import Any

from sqlalchemy import Connection

from server.participation import pairing, places
from server.participation.next_step import move_on, note
from server.participation.served_studies import Studies
from server.store import (
    answers,
    enrolment_limits,
    episodes,
    events,
    interventions,
    participants,
    studies,
    study_openings,
)
from server.store.enrolment_limits import EnrolmentLimit
from server.store.events import ATTENTION_SCREENED_OUT
from server.store.participants import NewParticipant, Participant
from server.store.unpaired import unpaired
from server.study.assignment import StudyFullError, next_condition, participant_seed
from server.study.definition import Study
from server.study.steps import StudyStep, has_rounds_for_two

_QUIZ_FAILED = "quiz_failed"  # kind of the event


class StudyPaused(StudyFullError):
    """A researcher paused the study: no new participants are accepted now."""


class ConsentChanged(Exception):
    """The study has another consent page than the one that the person has read."""


class AlreadyFinished(Exception):
    """The person's participation is over, and the recruiter's id alone does not reopen it."""


@dataclass(frozen=True)
class ConsentArrival:
    """A consent: for which study, with which cookie, from which link. `holder`: the participant whose
    cookie the browser had before. `text`: the fingerprint of the consent page that was read; empty: not known."""

    study: str
    token: str
    language: str = "en"
    person: str | None = None
    extra: Mapping[str, str] = field(default_factory=dict)
    simulated: bool = False
    holder: str | None = None
    text: str = ""


@dataclass(frozen=True)
class Submission:
    """A submitted page: its step and its checked answers."""

    step: StudyStep
    answers: Mapping[str, Any] = field(default_factory=dict)
    attention: Mapping[str, bool] = field(default_factory=dict)  # attention check -> whether it was passed
    attempt: int = 0  # of the quiz, from 1: the number that the page carried


@dataclass(frozen=True)
class FailedQuiz:
    """A wrong attempt at the quiz. `wrong`: the answers given to the questions that were missed."""

    attempt: int
    wrong: Mapping[str, Any]


def known(connection: Connection, all_studies: Studies, name: str, person: str | None) -> Participant | None:
    """Return the participant whom the recruiter sent before, in any version of the study: also in one that another
    process has just opened. Nobody can continue in a version that can no longer be read; they may begin again."""
    for study_id in reversed(studies.ids_of(connection, name)) if person else ():
        found = participants.by_recruitment_id(connection, study_id, person or "")
        if found is not None and (found.status != "active" or all_studies.can_read(connection, study_id)):
            return found
    return None


def already_here(connection: Connection, all_studies: Studies, arrival: ConsentArrival) -> Participant | None:
    """Return the participant who sent this page before, or whom the recruiter sent before."""
    same_page = participants.by_token(connection, arrival.token)
    return same_page or known(connection, all_studies, arrival.study, arrival.person)


def has_news(connection: Connection, participant_id: str, extra: Mapping[str, str]) -> bool:
    """Return whether the link has other parameters than those stored: a new assignment, a new session."""
    kept = participants.personal_of(connection, participant_id)
    return any(kept.get(name) != value for name, value in extra.items())


def enrol(connection: Connection, all_studies: Studies, arrival: ConsentArrival) -> Participant:
    """Create the participant who consents now, in the next condition among people or among bots; or return the person's
    existing participant, who continues with the new cookie and the link's newest parameters. Raises StudyFullError,
    StudyPaused, StudyClosed, AlreadyFinished, ConsentChanged."""
    same_page = participants.by_token(connection, arrival.token)
    if same_page is not None:
        return same_page
    before = known(connection, all_studies, arrival.study, arrival.person)
    if before is not None:
        if before.status != "active" and before.id != arrival.holder:
            raise AlreadyFinished(arrival.study)
        participants.replace_token(connection, before.id, arrival.token)
        participants.renew_personal(connection, before.id, before.study_id, arrival.extra)
        return before
    study_openings.check_open(connection, arrival.study)
    opened = all_studies.open(arrival.study)
    if opened is None:
        raise study_openings.StudyClosed(arrival.study)
    study_id, study = opened
    if is_paused(connection, study.name):
        raise StudyPaused(study.name)
    if arrival.text not in ("", study.consent.fingerprint):
        raise ConsentChanged(study.name)
    places.release(connection, all_studies, study)
    row = studies.get(connection, study_id)
    number = row.enrolled(arrival.simulated) if row else 0
    of_version = places.held(connection, (study_id,), study, arrival.simulated)
    of_study = places.held(connection, studies.ids_of(connection, study.name), study, arrival.simulated)
    waiting = _unpaired(connection, study_id, study, arrival.simulated)
    new = NewParticipant(
        study_id=study_id,
        condition=next_condition(study, of_version, number, of_study, waiting),
        seed=participant_seed(study, number),
        token=arrival.token,
        language=arrival.language,
        simulated=arrival.simulated,
        recruitment_id=arrival.person,
        personal=arrival.extra,
    )
    return participants.create(connection, new)


def _unpaired(connection: Connection, study_id: int, study: Study, simulated: bool) -> dict[str, int]:
    """Return how many people (or bots) of each condition have not met a partner yet. Those who were not seen for
    `hold_min` may have gone; nobody is sent to wait with them."""
    if not has_rounds_for_two(study):
        return {}
    return unpaired(connection, study_id, places.unseen_before(connection, study, study.hold_min), simulated)


def enrol_within(
    connection: Connection, all_studies: Studies, arrival: ConsentArrival, limits: Sequence[EnrolmentLimit]
) -> None:
    """Do the same as `enrol`, but a new participant counts against the limits of the address. Also raises
    EnrolmentLimitReached."""
    now = datetime.now(UTC)
    if already_here(connection, all_studies, arrival) is None:
        enrolment_limits.check(connection, limits, now)
        enrolment_limits.take(connection, limits, now)
    enrol(connection, all_studies, arrival)


def is_paused(connection: Connection, study: str) -> bool:
    """Return whether a researcher has paused the study."""
    return study in interventions.paused_studies(connection)


def arrive(connection: Connection, all_studies: Studies, participant_id: str) -> Participant | None:
    """Handle the opening of the current step's page: advance past a game that is over, and store the visit."""
    participant = participants.get(connection, participant_id)
    if participant is None or participant.status != "active":
        return participant
    if places.is_lost(connection, all_studies, participant):
        return participants.get(connection, participant_id)
    sequence = all_studies.steps_of(participant)
    step = sequence[min(participant.position, len(sequence) - 1)]
    if step.is_game and _is_over(connection, participant, step):
        move_on(connection, all_studies, participant)
        participant = participants.get(connection, participant_id)
        step = sequence[participant.position] if participant else step
    if participant and pairing.leave_without_partner(connection, all_studies, participant):
        return participants.get(connection, participant_id)
    answers.enter(connection, participant_id, step.key)
    participants.seen(connection, participant_id)
    return participants.get(connection, participant_id)


def submit(connection: Connection, all_studies: Studies, participant_id: str, submission: Submission) -> bool:
    """Store a page's answers and advance to the next step. Returns False, and changes nothing, if the
    participant has left that step: the page was sent twice, from another tab, or after the end."""
    participant = participants.get(connection, participant_id)
    if participant is None or participant.status != "active":
        return False
    if places.is_lost(connection, all_studies, participant):
        return False
    sequence = all_studies.steps_of(participant)
    step = sequence[min(participant.position, len(sequence) - 1)]
    if step.key != submission.step.key or step.kind == "thanks":
        return False
    if step.kind == "quiz" and submission.attempt != quiz_attempt(connection, participant_id):
        return False
    if step.is_game and not _is_over(connection, participant, step):
        if step.kind != "tutorial" or not all_studies.of(participant).tutorial.skippable:
            return False
        note(connection, participant_id, {"tutorial_skipped": {}})
    took_ms = answers.leave(connection, participant_id, step.key)
    episode = episodes.of_step(connection, participant_id, f"episode-{step.number:02d}") if step.number else None
    about = episode.id if episode is not None and step.kind == "questionnaire" else None
    checks = submission.attention
    answers.save(
        connection, answers.SubmittedPage(participant_id, step.key, submission.answers, about, took_ms, checks)
    )
    failed = [question for question, passed in checks.items() if not passed]
    if failed:
        note(connection, participant_id, {"attention_failed": {"step": step.key, "questions": failed}})
        if _screened_out(connection, participant_id, all_studies.of(participant)):
            return True
    return move_on(connection, all_studies, participant)


def _screened_out(connection: Connection, participant_id: str, study: Study) -> bool:
    """End the participation if as many attention checks were failed as the study allows. The answers stay stored."""
    limit = study.attention.screen_out_after
    count = answers.attention_of(connection, participant_id)
    if limit is None or count.failed < limit or not participants.leave(connection, participant_id, "screened_out"):
        return False
    note(connection, participant_id, {ATTENTION_SCREENED_OUT: {"failed": count.failed, "answered": count.answered}})
    return True


def quiz_attempt(connection: Connection, participant_id: str) -> int:
    """Return the number, from 1, of the participant's current attempt at the quiz."""
    return 1 + len(events.of_participant(connection, participant_id, _QUIZ_FAILED))


def wrong_quiz(connection: Connection, all_studies: Studies, participant_id: str, failed: FailedQuiz) -> bool:
    """Count a failed attempt; the last one that the study allows ends the participation.

    Return whether `failed` is the participant's latest failed attempt, counted now or before: its page is then shown
    with its faults. False: it belongs to an earlier attempt, or the participant is past the quiz. Sending an attempt
    again changes nothing, however often and in whatever order its copies arrive.
    """
    participant = participants.get(connection, participant_id)
    if participant is None or participant.status != "active" or all_studies.step(participant).kind != "quiz":
        return False
    before = events.of_participant(connection, participant_id, _QUIZ_FAILED)
    if failed.attempt != len(before) + 1:
        return failed.attempt == len(before) > 0 and before[-1].detail.get("answers") == dict(failed.wrong)
    note(connection, participant_id, {_QUIZ_FAILED: {"answers": dict(failed.wrong), "attempt": failed.attempt}})
    quiz = all_studies.of(participant).quiz
    if quiz is not None and quiz.attempts is not None and failed.attempt >= quiz.attempts:
        participants.leave(connection, participant_id, "screened_out")
        return False
    return True


def by_code(connection: Connection, name: str, code: str) -> Participant | None:
    """Return the participant with this completion code, in any version of the study: data of one that can no
    longer be read can still be deleted."""
    for study_id in studies.ids_of(connection, name) if code else ():
        found = participants.by_code(connection, study_id, code)
        if found is not None:
            return found
    return None


def last_episode(connection: Connection, participant_id: str, number: int) -> episodes.StoredEpisode | None:
    """Return the episode before the `number`-th, for the page before a round."""
    return episodes.of_step(connection, participant_id, f"episode-{number - 1:02d}") if number > 1 else None


def _is_over(connection: Connection, participant: Participant, step: StudyStep) -> bool:
    """Return whether a game is over: a tutorial must be passed, an episode must have ended for any reason, also because
    the partner's withdrawal deleted it."""
    episode = episodes.of_step(connection, participant.id, step.key)
    if episode is None:
        return pairing.is_deleted(connection, participant.id, step)
    return bool(episode.passed) if step.kind == "tutorial" else episode.status in ("done", "aborted")
