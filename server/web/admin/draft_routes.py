"""All routes of studies that are written in the dashboard."""

from fastapi import APIRouter

from server.web.admin import draft_actions, draft_pages, draft_preview, draft_rehearsal, preview_play

PARTS = (draft_pages, draft_actions, preview_play, draft_preview, draft_rehearsal)
router = APIRouter()
for _part in PARTS:
    router.include_router(_part.router)
