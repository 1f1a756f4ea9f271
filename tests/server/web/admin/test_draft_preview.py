"""The preview of a draft: every button and link of a participant's page leads somewhere, or says why not."""

import re

from tests.support.draft_site import admin_site_fixture as admin_site_fixture
from tests.support.draft_site import asked, begun, source
from tests.support.draft_site import file as file
from tests.support.draft_site import site as site
from tests.support.page_site import PageSite
from tests.support.researcher_site import Researcher, signed_in

NOTHING = "In the preview, this does nothing."


def previewed(site: PageSite) -> tuple[Researcher, str, str]:
    """A researcher, the overview of a draft's preview, and the address of a condition's pages."""
    researcher = signed_in(site, "own")
    draft = begun(site, researcher)
    overview = f"/admin/drafts/{draft}/preview"
    condition = re.search(rf"{overview}/(\w+)/en/consent", researcher.get(overview).text)
    assert condition
    return researcher, overview, f"{overview}/{condition[1]}"


def test_what_leads_out_of_a_study_stays_in_the_preview_and_says_so(site: PageSite) -> None:
    researcher, _, pages = previewed(site)
    for page, link in (("consent", "decline"), ("consent", "withdraw"), ("0", "new"), ("0", "withdraw")):
        found = researcher.get(f"{pages}/en/{page}/{link}")
        assert (found.url.path, NOTHING in found.text) == (f"{pages}/en/{page}", True), link
        assert NOTHING not in researcher.get(f"{pages}/en/{page}").text
    onwards = researcher.get(f"{pages}/en/consent/consent")
    assert (onwards.url.path, NOTHING in onwards.text) == (f"{pages}/en/0", False)


def test_the_languages_of_a_previewed_page_are_links_that_change_its_language(site: PageSite) -> None:
    researcher, overview, _ = previewed(site)
    draft = int(overview.split("/")[3])
    text = source(site, draft)
    assert "languages: [en, zh]" in text
    assert asked(researcher, draft, "save", text=text, revision="2")[0] == 200
    for page in ("consent", "0"):
        shown = researcher.get(f"{overview}/with/en/{page}").text
        assert 'href="?lang=zh"' in shown
        chinese = researcher.get(f"{overview}/with/en/{page}?lang=zh")
        assert chinese.url.path == f"{overview}/with/zh/{page}"
        assert '<html lang="zh"' in chinese.text


def test_the_last_page_of_a_preview_shows_where_the_code_will_be(site: PageSite) -> None:
    researcher, overview, pages = previewed(site)
    last = max(int(number) for number in re.findall(rf"{pages}/en/(\d+)", researcher.get(overview).text))
    assert "KM-XXXX-XXXX</output>" in researcher.get(f"{pages}/en/{last}").text
