"""Routes that show a draft as its participants see it, page by page. Nothing is stored; preview_play.py has games."""

import asyncio
from dataclasses import dataclass, field, replace
from datetime import UTC, datetime
from typing import Any, Final

from fastapi import APIRouter, HTTPException, Request, Response

from server.participation.episode_specs import layout_of
from server.participation.served_studies import Studies
from server.store.database import Database
from server.store.participants import Participant
from server.store.study_drafts import StudyDraft
from server.study import drafting
from server.study.definition import EntryChecks, KitchenChoice, Study
from server.study.steps import StudyStep
from server.web.admin.draft_pages import WholeDraftDep
from server.web.admin.rendering import OUTCOMES, AdminPage, back_to
from server.web.admin.researcher_auth import OwnDep
from server.web.dependencies import PageResponse, Web
from server.web.participant.views import consent_context, render_step

router = APIRouter(prefix="/admin/drafts/{draft}/preview")
CONSENT: Final = "consent"
_SEED: Final = 1  # of the participant who is shown
_CODE: Final = "KM-XXXX-XXXX"  # of the participant who is shown
_STAYS: Final = "preview_stays"  # the outcome of what a study would do elsewhere, such as leaving it
_ALL_STEPS: Final = "Open the preview again and choose one of its steps."
_ANY_DEVICE: Final = EntryChecks(width=0, height=0, input=False, websocket=False, latency_ms=None)


class PreviewedStudies(Studies):
    """The one study of a draft, known to no database."""

    def __init__(self, study: Study) -> None:
        super().__init__()
        self._versions, self._open = {0: study}, {study.name: 0}

    async def earlier_answers(self, database: Database, participant: Participant) -> None:
        """Return None: nothing was answered, so what depends on answers is shown."""


@dataclass(frozen=True)
class PreviewPage(PageResponse):
    """A participant's page whose forms and links stay in the preview."""

    shown: dict[str, Any] = field(default_factory=dict)

    def render(self, template: str, status: int = 200, **context: Any) -> Response:
        return super().render(template, status, **(context | self.shown))


@dataclass(frozen=True)
class PreviewPlace:
    """Where somebody is in a preview: the draft's study, a condition, a language, and a step."""

    study: Study
    condition: str
    language: str
    sequence: tuple[StudyStep, ...]

    def participant(self, position: int) -> Participant:
        now = datetime.now(UTC)
        here = (self.condition, _SEED, position, "active", self.language)
        return Participant("preview", 0, 1, 1, *here, True, now, now, None, _CODE)

    def kitchen(self, step: StudyStep) -> KitchenChoice:
        """Return where a round or the practice is played."""
        return self.study.tutorial.layout if step.kind == "tutorial" else self.study.layout(step.layout)


def _studied(draft: StudyDraft) -> Study:
    view = drafting.view(draft.source)
    if view.file is None:
        raise HTTPException(409, "This draft has problems, so it has no preview. Correct them first.")
    return view.file.study.model_copy(update={"entry": _ANY_DEVICE})


def place_of(study: Study, condition: str, language: str) -> PreviewPlace:
    if condition not in {one.name for one in study.conditions} or language not in study.languages:
        raise HTTPException(404, f"The draft does not have this condition or language now. {_ALL_STEPS}")
    participant = PreviewPlace(study, condition, language, ()).participant(0)
    return PreviewPlace(study, condition, language, PreviewedStudies(study).steps_of(participant))


@router.get("")
async def overview(request: Request, admin: OwnDep, draft: WholeDraftDep) -> Response:
    """List the steps of each condition, each with a link to its page."""
    study = await asyncio.to_thread(_studied, draft)
    sequences = {one.name: place_of(study, one.name, study.languages[0]).sequence for one in study.conditions}
    page = AdminPage(request, admin)
    return page.render("draft_preview.html", tab="drafts", draft=draft, previewed=study, sequences=sequences)


@router.get("/{condition}/{language}/{position}")
async def step(
    request: Request,
    condition: str,
    language: str,
    position: str,
    admin: OwnDep,  # noqa: ARG001 - checks who asks
    draft: WholeDraftDep,
) -> Response:
    """Show one page as a participant in the condition sees it. `?lang=zh`, as the page's links have it, leads to the
    same page in that language."""
    place = place_of(await asyncio.to_thread(_studied, draft), condition, language)
    if (chosen := request.query_params.get("lang", language)) != language and chosen in place.study.languages:
        return back_to(f"/admin/drafts/{draft.id}/preview/{condition}/{chosen}/{position}")
    number = number_of(position)
    if number >= len(place.sequence):
        raise HTTPException(404, f"The draft does not have this step now. {_ALL_STEPS}")
    made = preview_page(request, draft, place, number)
    if number < 0:
        context = consent_context(place.study, language, None, {}, "preview-" * 3)
        return made.render("participant/consent.html", **context)
    here = place.sequence[number]
    if not here.is_game:
        return await render_step(made, place.participant(number), None, 200)
    kitchen = place.kitchen(here)
    agent = place.study.tutorial.agent.name if here.kind == "tutorial" else here.agent
    return made.render(
        "participant/preview_game.html",
        step=here,
        kitchen=kitchen,
        agent=agent,
        rows=layout_of(kitchen).text.splitlines(),
        refused=OUTCOMES.get(request.query_params.get("outcome", "")),
    )


def number_of(position: str) -> int:
    """Return the index of a step; -1 for the consent page. Answers 404 for anything else."""
    if position == CONSENT:
        return -1
    if not (position.isascii() and position.isdigit() and len(position) < 6):
        raise HTTPException(404, f"The draft has no such step. {_ALL_STEPS}")
    return int(position)


def preview_page(request: Request, draft: StudyDraft, place: PreviewPlace, number: int) -> PreviewPage:
    web: Web = AdminPage(request).web
    here = f"{web.csrf.root}/admin/drafts/{draft.id}/preview/{place.condition}/{place.language}"
    names = [CONSENT, *(str(index) for index in range(len(place.sequence)))]
    at = number + 1
    preview = {
        "draft": f"{web.csrf.root}/admin/drafts/{draft.id}",
        "condition": place.condition,
        "before": f"{here}/{names[at - 1]}" if at else "",
        "after": f"{here}/{names[at + 1]}" if at + 1 < len(names) else "",
        "place": f"{at + 1} of {len(names)}",
        "note": OUTCOMES[_STAYS] if request.query_params.get("outcome") == _STAYS else "",
    }
    person = place.participant(max(number, 0)) if number >= 0 else None
    studies = PreviewedStudies(place.study)
    shown = {"path": f"{here}/{names[at]}", "draft_preview": preview}
    return PreviewPage(request, replace(web, studies=studies), place.language, place.study, person, shown=shown)


@router.get("/{condition}/{language}/{position}/{what}")
@router.post("/{condition}/{language}/{position}/{what}")
async def next_page(
    condition: str,
    language: str,
    position: str,
    what: str,
    admin: OwnDep,  # noqa: ARG001 - checks who asks
    draft: WholeDraftDep,
) -> Response:
    """Redirect to the next page when a page of the preview is submitted, or back to the same with a note; the submitted
    values are not read."""
    here = f"/admin/drafts/{draft.id}/preview/{condition}/{language}"
    sequence = place_of(await asyncio.to_thread(_studied, draft), condition, language).sequence
    number = number_of(position)
    leads_on = what in ("now", "consent")
    follows = min(number + leads_on, len(sequence) - 1)
    return back_to(f"{here}/{follows if follows >= 0 else CONSENT}", "" if leads_on else _STAYS)
