"""The report as a co-author opens it: from a file, without a network, on a laptop, a phone and paper."""

from pathlib import Path

import pytest
from playwright.sync_api import Browser

from analysis.report import write_report
from analysis.synthetic import Truth, write_export
from tests.support.declaring import declaring

pytestmark = pytest.mark.browser


@pytest.fixture(scope="module")
def page_file(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("study")
    write_export(Truth(participants=6, reward_effect={"tom": 20.0}, timesteps=30), folder / "data")
    declared = "primary: {comparison: [tom, none], looks: [12, 60]}\nsmallest_effect: {reward: 8, answers: 0.5}\n"
    return write_report(declaring(folder / "data", folder / "declared", declared), folder / "report").page


@pytest.mark.slow
def test_the_report_fits_a_laptop_and_a_phone_and_needs_no_network(chromium: Browser, page_file: Path) -> None:
    for width, height in ((1366, 768), (390, 844)):
        page = chromium.new_page(viewport={"width": width, "height": height})
        found: list[str] = []
        page.on("console", lambda message, found=found: found.append(message.text))
        page.on("pageerror", lambda error, found=found: found.append(str(error)))
        page.on("request", lambda request, found=found: found.append(request.url))
        page.goto(page_file.as_uri())
        assert page.evaluate("document.documentElement.scrollWidth") <= width
        assert [text for text in found if not text.startswith((page_file.as_uri(), "data:"))] == []
        page.close()


@pytest.mark.slow
def test_no_table_is_cut_off_on_paper(chromium: Browser, page_file: Path) -> None:
    page = chromium.new_page(viewport={"width": 680, "height": 1000})  # the text width of A4 at 96 dpi
    page.emulate_media(media="print")
    page.goto(page_file.as_uri())
    wide = page.evaluate(
        "[...document.querySelectorAll('table')].filter(t => t.getBoundingClientRect().right > innerWidth + 1).length"
    )
    assert wide == 0
    page.close()
