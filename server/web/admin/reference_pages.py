"""Routes of the reference of study files, which the study builder links to: the same pages as in the documentation."""

import asyncio
import re
from functools import cache
from itertools import pairwise

from fastapi import APIRouter, HTTPException, Request, Response
from markupsafe import Markup

from server.study.reference import anchor, study_reference
from server.study.sections import SECTIONS, StudySection
from server.web.admin.rendering import NOT_FOUND, AdminPage
from server.web.admin.researcher_auth import OwnDep
from server.web.markdown import MARKDOWN

router = APIRouter(prefix="/admin/study-keys")


@router.get("/{section}")
async def one_section(request: Request, admin: OwnDep, section: str) -> Response:
    """Show every key of a section: type, default, example, meaning."""
    shown = next((one for one in SECTIONS if one.name == section), None)
    if shown is None:
        known = ", ".join(one.name for one in SECTIONS)
        raise HTTPException(
            NOT_FOUND,
            f"The study file has no section {section!r}. Choose one of {known}.",
        )
    text = await asyncio.to_thread(_html, shown)  # the first call reads the sources, and games must not wait
    page = AdminPage(request, admin)
    return page.render("study_keys.html", tab="drafts", sections=SECTIONS, shown=shown, text=text)


@cache
def _html(section: StudySection) -> Markup:
    """Return a section's tables as HTML, with headings that links reach and tables that scroll."""
    words = study_reference().tables(section)
    tokens = MARKDOWN.parse(re.sub(r"\((\w+)\.md#", r"(\1#", words))
    for token, inside in pairwise(tokens):
        if token.type == "heading_open":
            token.attrSet("id", anchor(inside.content))
    html = MARKDOWN.renderer.render(tokens, MARKDOWN.options, {})
    html = html.replace("<table>", '<div class="tablebox"><table class="list">').replace("</table>", "</table></div>")
    return Markup(html)  # noqa: S704 - made from the code; HTML in it is escaped
