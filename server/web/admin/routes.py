"""All routes of researchers: everything below /admin."""

from fastapi import APIRouter

from server.web.admin import (
    actions,
    data_pages,
    downloads,
    draft_routes,
    kitchen_pages,
    live_boards,
    opened_games_page,
    reference_pages,
    replay_page,
    report_pages,
    researcher_pages,
)

router = APIRouter()
for _module in (
    researcher_pages,
    live_boards,
    replay_page,
    opened_games_page,
    actions,
    downloads,
    report_pages,
    data_pages,
    kitchen_pages,
    draft_routes,
    reference_pages,
):
    router.include_router(_module.router)
