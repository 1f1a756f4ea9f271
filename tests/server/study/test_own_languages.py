"""An additional language, in the folder `locales` next to a study."""

from collections.abc import Iterator
from pathlib import Path

import pytest

from server.playable_studies import playable_studies
from server.settings import Settings
from server.study import locale as locales
from server.study import own_languages
from server.study.loader import StudyError, load_study
from server.study.locale import languages, locale, words_in
from tests.support.command_line import run
from tests.support.study_text import SMALL_STUDY

ENGLISH = words_in((locales.LOCALES / "en.yaml").read_text("utf-8"))


@pytest.fixture(autouse=True)
def forget() -> Iterator[None]:
    yield
    locales._ADDED.clear()
    for function in (locales.locale, locales.languages, locales._words):
        function.cache_clear()


@pytest.fixture
def study(tmp_path: Path) -> Path:
    file = tmp_path / "small.yaml"
    text = SMALL_STUDY.replace("languages: [en, zh]", "languages: [en, zh, tlh]").replace("zh:", "tlh: x, zh:")
    file.write_text(text, encoding="utf-8")
    return file


def written(study: Path) -> Path:
    made = run("study", "words", "tlh", str(study))
    assert made.returncode == 0, made.stderr
    return study.parent / "locales" / "tlh.yaml"


def test_the_file_has_every_entry_empty_next_to_the_english_text(study: Path) -> None:
    path = written(study)
    text = path.read_text("utf-8")
    assert words_in(text) == dict.fromkeys(ENGLISH, "")
    lines = text.splitlines()
    assert '  start: ""  # Take part' in lines
    assert 'minutes: ""  # {minutes} min' in lines
    assert all(any(line.endswith(f"# {words}") for line in lines) for words in ENGLISH.values())


def test_a_server_finds_the_languages_of_its_data_folder_for_studies_made_in_the_dashboard(tmp_path: Path) -> None:
    settings = Settings(data=tmp_path, studies=(Path("studies/quick_look.yaml"),))
    assert run("study", "words", "tlh", str(tmp_path)).returncode == 0
    path = tmp_path / "locales" / "tlh.yaml"
    path.write_text(path.read_text("utf-8").replace('name: ""', "name: tlhIngan Hol"), "utf-8")
    playable_studies(settings)
    assert locales.locale("tlh").name == "tlhIngan Hol"
    path.write_text("name: [\n", "utf-8")
    with pytest.raises(StudyError, match=r"tlh\.yaml:"):
        playable_studies(settings)


def test_the_loader_finds_what_is_translated_and_shows_the_rest_in_english(study: Path) -> None:
    assert load_study(study).warnings != ()
    path = written(study)
    text = (
        path.read_text("utf-8")
        .replace('name: ""', "name: tlhIngan Hol")
        .replace('minutes: ""', 'minutes: "{minutes} tup"')
    )
    path.write_text(text, encoding="utf-8")
    file = load_study(study)
    assert file.warnings == ()
    assert "tlh" in languages()
    words = locale("tlh")
    assert (words.name, words("minutes", minutes=3), words("continue")) == ("tlhIngan Hol", "3 tup", "Continue")
    assert file.study.tutorial.layout.title.of("tlh") == ENGLISH["game.practice"]
    path.write_text(text.replace("tlhIngan Hol", "Klingon"), encoding="utf-8")
    load_study(study)
    assert locale("tlh").name == "Klingon", "a study that is read again has the words as they are now"


def test_run_again_it_lists_what_is_missing_and_obsolete_and_changes_nothing(study: Path) -> None:
    path = written(study)
    text = path.read_text("utf-8").replace('done: ""', 'done: "rIn"').replace('back: ""', "")
    path.write_text(text + "\nold:\n  word: qa'\n", encoding="utf-8")
    before = path.read_bytes()
    again = run("study", "words", "tlh", str(study.parent))
    assert again.returncode == 0
    assert path.read_bytes() == before
    lines = again.stdout.splitlines()
    assert lines[0] == f"{path}: {len(ENGLISH) - 1} missing, shown in English; 1 obsolete, not used"
    assert "  missing   back: Back" in lines
    assert "  obsolete  old.word" in lines
    assert not any("missing   done" in line for line in lines)


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        (
            'minutes: ""',
            'minutes: "{minuten} Min."',
            "minutes: the words in braces differ from the English ones. Use {minutes}.",
        ),
        (
            'minutes: ""',
            'minutes: "{minutes Min."',
            "minutes: the words in braces differ from the English ones. Use {minutes}.",
        ),
        ('done: ""', 'done: "{} rIn"', "done: the words in braces differ from the English ones. Use no braces."),
        ('done: ""', 'done: "rIn', "this is not valid YAML"),
    ],
)
def test_a_file_that_would_break_a_page_is_refused_with_its_line(study: Path, old: str, new: str, words: str) -> None:
    path = written(study)
    text = path.read_text("utf-8")
    line = text[: text.index(old)].count("\n") + 1
    path.write_text(text.replace(old, new), encoding="utf-8")
    with pytest.raises(StudyError) as caught:
        load_study(study)
    assert words in caught.value.lines[0]
    assert caught.value.lines[0].startswith(f"{path}:{line}: ") or "YAML" in words
    again = run("study", "words", "tlh", str(study))
    assert (again.returncode, words in again.stderr) == (2, True)


@pytest.mark.parametrize("content", [b"- one\n", b"word", b"\xff\xfe", b""])
def test_a_file_without_words_is_refused(study: Path, content: bytes) -> None:
    path = written(study)
    path.write_bytes(content)
    with pytest.raises(StudyError, match=r"tlh.yaml:1: this is not"):
        load_study(study)


def test_the_platform_s_own_words_stay(study: Path) -> None:
    (study.parent / "locales").mkdir()
    (study.parent / "locales" / "zh.yaml").write_text("continue: nope\n", encoding="utf-8")
    load_study(study)
    assert locale("zh")("continue") == "继续"


@pytest.mark.parametrize(
    ("words", "reason"),
    [
        (("zh",), "already has words in 'zh'"),
        (("../x",), "is not the code of a language"),
        (("de", "nowhere"), "nowhere does not exist. Give a study file or its folder."),
    ],
)
def test_a_change_that_cannot_be_written_gives_a_reason(words: tuple[str, ...], reason: str) -> None:
    refused = run("study", "words", *words)
    assert (refused.returncode, reason in refused.stderr) == (2, True)


def test_a_file_of_the_template_is_what_is_looked_for(tmp_path: Path) -> None:
    assert own_languages.language_file(tmp_path, "pt-BR") == tmp_path / "locales" / "pt-BR.yaml"
