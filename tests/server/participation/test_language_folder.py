"""A language that is put into the data folder while a server runs."""

import asyncio
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path

import pytest

from server.participation import language_folder
from server.participation.language_folder import LanguageFolder
from server.study import locale as locales
from server.study.drafting import view
from tests.support.study_text import SMALL_STUDY

STUDY = SMALL_STUDY.replace("languages: [en, zh]", "languages: [en, zh, tlh]").replace("zh:", "tlh: x, zh:")


@pytest.fixture(autouse=True)
def forget() -> Iterator[None]:
    yield
    locales._ADDED.clear()
    locales._REFUSED.clear()
    for function in (locales.locale, locales.languages, locales._words):
        function.cache_clear()


@pytest.fixture
def file(tmp_path: Path) -> Path:
    (tmp_path / "locales").mkdir()
    return tmp_path / "locales" / "tlh.yaml"


def warnings() -> list[str]:
    return [problem.text for problem in view(STUDY).problems]


def test_a_language_appears_in_the_study_builder_without_a_restart(tmp_path: Path, file: Path) -> None:
    folder = LanguageFolder(tmp_path)
    folder.refresh()
    assert "no words in 'tlh'" in warnings()[0]
    file.write_text("name: tlhIngan Hol\n", encoding="utf-8")
    folder.refresh()
    assert warnings() == []
    assert locales.locale("tlh").name == "tlhIngan Hol"


def test_a_changed_word_is_used_and_a_broken_file_is_refused_with_its_line(tmp_path: Path, file: Path) -> None:
    file.write_text("name: one\n", encoding="utf-8")
    locales.add_language("tlh", {"name": "one"})
    folder = LanguageFolder(tmp_path)
    file.write_text("name: another\n", encoding="utf-8")
    folder.refresh()
    assert locales.locale("tlh").name == "another"
    file.write_text("name: [\n", encoding="utf-8")
    folder.refresh()
    (words,) = warnings()
    assert "tlh.yaml:" in words
    assert "cannot be used" in words
    assert locales.locale("tlh").name == "another", "participants keep the words that work"
    file.write_text("name: good again\n", encoding="utf-8")
    folder.refresh()
    assert (warnings(), locales.locale("tlh").name) == ([], "good again")


def test_a_file_that_breaks_after_it_was_read_breaks_no_page(tmp_path: Path, file: Path) -> None:
    folder = LanguageFolder(tmp_path)
    file.write_text("name: tlhIngan Hol\n", encoding="utf-8")
    folder.refresh()
    file.write_text("name: [\n", encoding="utf-8")
    assert locales.locale("tlh").name == "tlhIngan Hol", "the file is not read once more for a page"


def test_what_is_no_file_of_a_language_is_left_alone(tmp_path: Path, file: Path) -> None:
    folder = LanguageFolder(tmp_path)
    file.with_name("Notes on tlh.yaml").write_text("[", encoding="utf-8")
    file.with_name("en.yaml").write_text("name: mine\n", encoding="utf-8")
    file.mkdir()
    folder.refresh()
    assert set(locales.languages()) == {"en", "zh"}


def test_the_server_looks_again_and_again(tmp_path: Path, file: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(language_folder, "LOOK_EVERY_S", 0.01)
    folder = LanguageFolder(tmp_path)

    async def until_there() -> None:
        running = asyncio.create_task(folder.run())
        file.write_text("name: tlhIngan Hol\n", encoding="utf-8")
        while "tlh" not in locales.languages():
            await asyncio.sleep(0.01)
        running.cancel()
        with suppress(asyncio.CancelledError):
            await running

    asyncio.run(asyncio.wait_for(until_there(), 20))
