"""The reference of study files, as the study builder shows it."""

import re

import pytest

from server.study.sections import SECTIONS, StudySection
from server.web.admin import reference_pages
from tests.support.page_site import PageSite
from tests.support.researcher_site import signed_in
from tests.support.researcher_site import site as researcher_site

researcher_site_fixture = researcher_site


@pytest.fixture
def site(researcher_site_fixture: PageSite) -> PageSite:
    researcher_site_fixture.app.include_router(reference_pages.router)
    return researcher_site_fixture


@pytest.mark.parametrize("section", SECTIONS, ids=lambda section: section.name)
def test_a_section_names_its_keys_and_every_link_leads_to_a_heading(site: PageSite, section: StudySection) -> None:
    researcher = signed_in(site, "own")
    page = researcher.get(f"/admin/study-keys/{section.name}").text
    for key in section.keys:
        assert f"<td><code>{key}</code></td>" in page
    links = set(re.findall(r'href="(\w*)#(\w+)"', page)) - {("", "main")}
    for other, heading in links:
        target = researcher.get(f"/admin/study-keys/{other or section.name}").text
        assert re.search(rf'<h[23] id="{heading}"', target), f"{other}#{heading}"
    assert ".md" not in page


def test_an_unknown_section_is_not_found_and_only_owners_read_it(site: PageSite) -> None:
    answer = signed_in(site, "own").client.get("/admin/study-keys/nothing", headers={"accept": "application/json"})
    assert answer.status_code == 404
    assert "The study file has no section 'nothing'." in answer.text
    answer = signed_in(site, "act").client.get("/admin/study-keys/title", headers={"accept": "application/json"})
    assert answer.status_code == 403
