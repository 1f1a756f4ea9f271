"""Routes for what researchers do to a study, a game or a participant: POST only; each goes into the audit log."""

import asyncio
import logging
from collections.abc import Callable
from functools import partial
from typing import Annotated, Any

from fastapi import APIRouter, Depends, HTTPException, Response
from sqlalchemy import Connection

from server.cluster.command_dispatch import ClusterControl
from server.monitoring.commands import (
    EndGame,
    ExtendAbsence,
    MessageStudy,
    OpenVersion,
    PauseGame,
    PauseStudy,
    PrepareVersion,
    ResumeGame,
    ResumeStudy,
    SendMessage,
)
from server.store import audit, interventions, overview, participants, withdrawal
from server.store.admins import AdminSession
from server.store.overview import Person, Played
from server.study.loader import StudyError
from server.web import deletion
from server.web.admin.rendering import back_to, own_path, study_at
from server.web.admin.researcher_auth import ActDep, AdminFormDep
from server.web.control import ControlDep
from server.web.dependencies import Web, WebDep
from server.web.forms import Form, first, whole_number
from server.web.services import ServicesDep

log = logging.getLogger(__name__)
router = APIRouter(prefix="/admin/s/{name}")
MAX_TEXT_LENGTH = 500
MAX_MINUTES = 60
UNKNOWN_ACTION = "There is no such action. Reload the page and choose it again."
VERSION_TIMEOUT_S = 60.0  # loading a version's models takes seconds
OPEN_TIMEOUT_S = 1.0  # who misses it follows


async def _game(name: str, episode: str, web: WebDep) -> Played:
    """Return the episode if it belongs to this study. Answers 404 otherwise."""
    study_ids, _ = study_at(web, name)
    found = (await web.database.read(overview.played, episode)).get(episode)
    if found is None or found.study_id not in study_ids:
        raise HTTPException(404, "This study has no such game. Open it from the list of games.")
    return found


async def _person(name: str, person: str, web: WebDep) -> Person:
    study_ids, _ = study_at(web, name)
    found = await web.database.read(overview.person, person)
    if found is None or found.study_id not in study_ids:
        raise HTTPException(404, "This study has no such participant. Open them from the dashboard.")
    return found


GameDep = Annotated[Played, Depends(_game)]
PersonDep = Annotated[Person, Depends(_person)]


def _page_of(form: Form, study: str) -> str:
    """Return the page from which a form was sent: the study's, or its draft."""
    return own_path(first(form, "next")) if "next" in form else f"/admin/s/{study}"


@router.post("/pause")
async def pause_study(name: str, admin: ActDep, web: WebDep, form: AdminFormDep, control: ControlDep) -> Response:
    """Pause the study: until it is resumed, nobody can join and every game is paused."""
    study_at(web, name)
    detail = {"study": name, "reason": _text(form, "note")}
    await _change(web, admin, "pause study", detail, partial(interventions.pause_study, study=name, by=admin.name))
    await control.broadcast(PauseStudy(name))
    return back_to(_page_of(form, name), "study_paused")


@router.post("/resume")
async def resume_study(name: str, admin: ActDep, web: WebDep, form: AdminFormDep, control: ControlDep) -> Response:
    """Resume the study and its games."""
    study_at(web, name)
    detail = {"study": name, "reason": _text(form, "note")}
    await _change(web, admin, "resume study", detail, partial(interventions.resume_study, study=name, by=admin.name))
    await control.broadcast(ResumeStudy(name))
    return back_to(_page_of(form, name), "study_resumed")


@router.post("/version")
async def serve_version(name: str, admin: ActDep, services: ServicesDep, form: AdminFormDep) -> Response:
    """Serve the study file as it is now to new participants; the others keep their version."""
    web, versions = services.web, services.versions
    study_at(web, name)
    await asyncio.to_thread(versions.find_changes)
    if name not in versions.changed:
        return back_to(f"/admin/s/{name}", "version_unchanged")
    try:
        new = await versions.prepare_file(web.database, name)
    except (StudyError, OSError) as error:
        log.warning("the new version of %s is not served: %s", name, error)
        return back_to(f"/admin/s/{name}", "version_refused")
    if not await services.control.run_in_each(PrepareVersion(name, new.sha256), VERSION_TIMEOUT_S):
        log.warning("the new version of %s is not served: not every server process is ready for it", name)
        return back_to(f"/admin/s/{name}", "version_refused")
    await _note(web, admin, "serve new version", {"study": name, "version": new.sha256, "reason": _text(form, "note")})
    versions.open(new)
    await services.control.run_in_each(OpenVersion(name, new.sha256, new.opened_at), OPEN_TIMEOUT_S)
    return back_to(f"/admin/s/{name}", "version_served")


@router.post("/message")
async def message_all(name: str, admin: ActDep, web: WebDep, form: AdminFormDep, control: ControlDep) -> Response:
    """Show a message in every running game of the study."""
    study_at(web, name)
    text = _required(form, "text")
    reached = await control.broadcast(MessageStudy(name, text))
    await _note(web, admin, "message to all games", {"study": name, "text": text, "games": reached})
    return back_to(f"/admin/s/{name}", "sent" if reached else "gone")


@router.post("/game/{episode}/{action}")
async def intervene(
    action: str, admin: ActDep, web: WebDep, form: AdminFormDep, control: ControlDep, game: GameDep
) -> Response:
    """Pause, resume, end, message, extend or exclude one game."""
    detail: dict[str, Any] = {"episode": game.id, "participant": game.participant_id, "reason": _text(form, "note")}
    match action:
        case "pause" | "resume":
            outcome = await _pause_or_resume(action, admin, web, control, (game, detail))
            return back_to(_back(form), outcome)
        case "exclude":
            await _exclude(web, admin, form, (game.participant_id, game.id), "exclude game")
            return back_to(_back(form), "excluded")
        case "end":
            outcome = "ended" if await control.run(EndGame(game.id)) else "gone"
        case "message":
            detail["text"] = _required(form, "text")
            outcome = "sent" if await control.run(SendMessage(game.id, detail["text"])) else "gone"
        case "extend":
            detail["minutes"] = _minutes(form)
            return back_to(_back(form), await _extend(admin, web, control, (game, detail)))
        case _:
            raise HTTPException(404, UNKNOWN_ACTION)
    await _note(web, admin, f"{action} game", detail | {"done": outcome != "gone"})
    return back_to(_back(form), outcome)


async def _pause_or_resume(
    action: str, admin: AdminSession, web: Web, control: ClusterControl, what: tuple[Played, dict[str, Any]]
) -> str:
    """Return the outcome. A game that nobody plays now is paused when the participant comes back."""
    game, detail = what
    by = admin.name if action == "pause" else None
    change = partial(interventions.pause_game, episode=game.id, by=by)
    if not await _change(web, admin, f"{action} game", detail, change):
        return "gone"
    if action == "pause":
        await control.run(PauseGame(game.id))
        return "paused"
    await control.run(ResumeGame(game.id))
    study = web.studies.version(game.study_id)
    paused = await web.database.read(interventions.paused_studies)
    return "resumed_later" if study is not None and study.name in paused else "resumed"


async def _extend(admin: AdminSession, web: Web, control: ClusterControl, what: tuple[Played, dict[str, Any]]) -> str:
    """Return the outcome. A game that nobody plays now has the time when the participant comes back."""
    game, detail = what
    more_time_s = 0.0

    def allow(connection: Connection) -> float:
        nonlocal more_time_s
        more_time_s = interventions.allow_longer_absence(
            connection, game.id, game.participant_id, 60.0 * detail["minutes"]
        )
        return more_time_s

    if not await _change(web, admin, "extend game", detail, allow):
        return "gone"
    await control.run(ExtendAbsence(game.id, more_time_s))
    return "extended"


@router.post("/person/{person}/{action}")
async def decide(
    action: str, admin: ActDep, web: WebDep, form: AdminFormDep, control: ControlDep, person: PersonDep
) -> Response:
    """Exclude a participant, take an exclusion back, free the place, give more time to come back, or delete."""
    if action == "delete":
        return await _delete(admin, web, form, control, person)
    if action == "exclude":
        await _exclude(web, admin, form, (person.id, None), "exclude participant")
        return back_to(_back(form), "excluded")
    detail: dict[str, Any] = {"participant": person.id, "reason": _text(form, "note")}
    match action:
        case "restore":
            detail["exclusion"] = number = whole_number(form, "exclusion")
            change, outcome = partial(_restore, person=person.id, number=number, by=admin.name), "restored"
        case "release":
            change, outcome = partial(participants.leave, participant_id=person.id, status="returned"), "released"
        case "extend":
            change, outcome = partial(participants.give_more_time, participant_id=person.id), "extended"
        case _:
            raise HTTPException(404, UNKNOWN_ACTION)
    if not await _change(web, admin, f"{action} participant", detail, change):
        outcome = "gone"
    if outcome == "released":
        await _end_games(web, control, person)
    if outcome == "extended" and await web.database.read(participants.is_silent, person.id):
        outcome = "extended_silent"
    return back_to(_back(form), outcome)


def _restore(connection: Connection, person: str, number: int, by: str) -> bool:
    held = [one.id for one in interventions.exclusions_of(connection, [person])]
    return number in held and interventions.restore(connection, number, by)


async def _exclude(web: Web, admin: AdminSession, form: Form, data: tuple[str, str | None], action: str) -> None:
    """Exclude a participant's data: an episode, or (None) all."""
    (participant, episode), why = data, _why(form)
    detail = {"participant": participant, "reason": ": ".join(filter(None, why))}
    if episode is not None:
        detail["episode"] = episode
    change = partial(interventions.exclude, participant=participant, episode=episode, why=why, by=admin.name)
    await _change(web, admin, action, detail, change)


@router.post("/find")
async def find(name: str, admin: ActDep, web: WebDep, form: AdminFormDep) -> Response:
    """Lead to the participant with this id, personal code or recruiter's id: a form, as an address would be logged."""
    study_ids, _ = study_at(web, name)
    found = await web.database.read(participants.find, study_ids, _text(form, "who"))
    await _note(web, admin, "find participant", {"study": name, "found": found is not None})
    return back_to(f"/admin/s/{name}/person/{found.id}") if found else back_to(f"/admin/s/{name}", "nobody_found")


async def _end_games(web: Web, control: ClusterControl, person: Person) -> None:
    for played in await web.database.read(overview.played_by, person.id):
        if not played.is_over:
            await control.run(EndGame(played.id))


async def _delete(admin: AdminSession, web: Web, form: Form, control: ClusterControl, person: Person) -> Response:
    """Delete somebody who asked for it. The audit log records that and why, but nothing that identifies the person."""
    study = web.studies.version(person.study_id)
    name = study.name if study is not None else ""
    detail = {"study": name, "reason": _required(form, "note")}
    record = withdrawal.Deletion(admin.name, "delete participant", detail)
    done = await deletion.delete(web, control, person.id, record)
    return back_to(f"/admin/s/{name}", "deleted" if done else "gone")


async def _change(
    web: Web, admin: AdminSession, action: str, detail: dict[str, Any], change: Callable[[Connection], Any]
) -> bool:
    """Make a change with its line in the audit log, both or neither. False: there was nothing to change."""

    def both(connection: Connection) -> bool:
        done = bool(change(connection))
        audit.add(connection, admin.name, action, detail | {"done": done})
        return done

    return await asyncio.shield(web.database.write(both))


async def _note(web: Web, admin: AdminSession, action: str, detail: dict[str, Any]) -> None:
    await asyncio.shield(web.database.write(audit.add, admin.name, action, detail))


def _text(form: Form, name: str) -> str:
    return first(form, name).strip()[:MAX_TEXT_LENGTH]


def _required(form: Form, name: str) -> str:
    text = _text(form, name)
    if not text:
        raise HTTPException(400, f"The form has no valid {name}. Reload the page.")
    return text


def _why(form: Form) -> tuple[str, str]:
    reason = first(form, "reason")
    if reason not in interventions.EXCLUSION_REASONS:
        raise HTTPException(400, "This exclusion has no reason. Choose one from the list.")
    return reason, _text(form, "note")


def _minutes(form: Form) -> int:
    minutes = whole_number(form, "minutes")
    if not 1 <= minutes <= MAX_MINUTES:
        raise HTTPException(400, f"{minutes} minutes are not possible. Give 1 to {MAX_MINUTES}.")
    return minutes


def _back(form: Form) -> str:
    return own_path(first(form, "next"))
