"""Every kind of step has its page."""

from pathlib import Path
from typing import get_args

from server.study.steps import Kind
from server.web.participant.views import STEP_PAGES

TEMPLATES = Path(__file__).parents[4] / "templates" / "participant"


def test_every_kind_of_step_has_a_page_whose_template_exists() -> None:
    assert set(STEP_PAGES) == set(get_args(Kind))
    assert [template for template, _ in STEP_PAGES.values() if not (TEMPLATES / f"{template}.html").is_file()] == []
