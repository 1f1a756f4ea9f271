"""Routes that let a researcher play a round or the practice of a draft. Nothing of it is stored."""

import asyncio
import logging
from dataclasses import dataclass, replace
from typing import Annotated, Any

from fastapi import APIRouter, Depends, HTTPException, Request, Response, WebSocket
from starlette.requests import HTTPConnection

from server.participation.draft_checks import draft_problems
from server.participation.episode_specs import episode_spec, lessons
from server.play.close_codes import CloseCode
from server.store.study_drafts import StudyDraft
from server.study import drafting
from server.study.loader import StudyError, StudyFile
from server.study.steps import StudyStep
from server.web.admin.draft_pages import WholeDraftDep
from server.web.admin.draft_preview import PreviewPlace, number_of, place_of, preview_page
from server.web.admin.players import games_of_all
from server.web.admin.rendering import back_to
from server.web.admin.researcher_auth import OwnDep, session_of
from server.web.services import Services, ServicesDep

log = logging.getLogger(__name__)
router = APIRouter(prefix="/admin/drafts/{draft}/preview/{condition}/{language}/{position}")


@dataclass(frozen=True)
class GameAddress:
    """Which step of the preview an address names."""

    draft: StudyDraft
    condition: str
    language: str
    position: str

    def path(self, number: int) -> str:
        """Return the address of a page of this preview."""
        return f"/admin/drafts/{self.draft.id}/preview/{self.condition}/{self.language}/{number}"


def _address(draft: WholeDraftDep, condition: str, language: str, position: str) -> GameAddress:
    return GameAddress(draft, condition, language, position)


AddressDep = Annotated[GameAddress, Depends(_address)]


def _game(file: StudyFile, at: GameAddress) -> tuple[PreviewPlace, StudyStep]:
    """Return the game at this place. Answers 404 where the draft has none."""
    place, number = place_of(file.study, at.condition, at.language), number_of(at.position)
    if not 0 <= number < len(place.sequence) or not place.sequence[number].is_game:
        raise HTTPException(404, "The draft has no round here now. Open its preview again.")
    return place, place.sequence[number]


@router.get("/play")
async def play(
    request: Request,
    admin: OwnDep,  # noqa: ARG001 - checks who asks
    services: ServicesDep,
    at: AddressDep,
) -> Response:
    """Show the page of the game, once its models are loaded."""
    file = await asyncio.to_thread(_playable, at.draft.source, services)
    if file is None:
        return back_to(f"/admin/drafts/{at.draft.id}", "draft_faulty")
    place, step = _game(file, at)
    here = at.path(number_of(at.position))
    if await games_of_all(services):
        return back_to(here, "preview_players")
    try:
        await services.previews.models.load(file, place.kitchen(step))
    except StudyError as error:
        log.warning("a round of the draft %d cannot be played: %s", at.draft.id, error)
        return back_to(here, "preview_models")
    game: dict[str, Any] = {"socket": f"{here}/socket", "leave": here, "leave_word": "Back to the preview"}
    game["lessons"] = lessons(place.study, place.study.condition(at.condition)) if step.kind == "tutorial" else ()
    game["away_s"] = place.study.game.pause.each_s
    made = preview_page(request, at.draft, place, number_of(at.position))
    return made.render("participant/game.html", step=step, game=game)


def _playable(source: str, services: Services) -> StudyFile | None:
    """Return the draft as a study, unless something keeps it from being opened: its models are run here, and a file, a
    class or an address that a draft may not name is an error, too."""
    file, versions = drafting.view(source).file, services.versions
    if file is None:
        return None
    file = versions.as_opened(file, {})
    return file if all(one.warning for one in draft_problems(file, versions.of_files())) else None


async def _of_owner(connection: HTTPConnection, services: ServicesDep) -> bool:
    """Return whether the socket is from one of our pages, of a researcher who may write studies."""
    session = await session_of(connection) if services.web.csrf.is_own_origin(connection) else None
    return session is not None and session.may("own")


@router.websocket("/socket")
async def socket_of_game(
    socket: WebSocket, may: Annotated[bool, Depends(_of_owner)], services: ServicesDep, at: AddressDep
) -> None:
    """Play one round."""
    if not may:
        return await socket.close(CloseCode.REFUSED)
    file = await asyncio.to_thread(_playable, at.draft.source, services)
    try:
        found = _game(file, at) if file else None
    except HTTPException:
        found = None
    if file is None or found is None:
        return await socket.close(CloseCode.NO_GAME)
    await _serve(socket, services, file, *found, at)


async def _serve(
    socket: WebSocket, services: Services, file: StudyFile, place: PreviewPlace, step: StudyStep, at: GameAddress
) -> None:
    spec = episode_spec(place.study, step, at.condition, at.language)
    following = min(number_of(at.position) + 1, len(place.sequence) - 1)
    try:
        async with services.previews.models.playing(file, place.kitchen(step)) as layout:
            await services.previews.serve(socket, replace(spec, layout=layout), at.path(following))
    except StudyError as error:
        log.warning("a round of the draft %d cannot be played: %s", at.draft.id, error)
        await socket.close(CloseCode.NO_GAME)
