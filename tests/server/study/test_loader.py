"""Study files with one thing wrong: the message names line, reason and remedy."""

from pathlib import Path

import pytest

from server.study import loader
from server.study.loader import StudyError, load_study, parse_study
from server.study.text import Text
from tests.support.study_text import SMALL_STUDY


def line_of(words: str, text: str = SMALL_STUDY) -> int:
    return text[: text.index(words)].count("\n") + 1


def errors(text: str) -> tuple[str, ...]:
    with pytest.raises(StudyError) as raised:
        parse_study(text, "small.yaml")
    return raised.value.lines


FLOW, PRIMARY = "flow: [everything,", "primary: {comparison: [with, without]"
SMALLEST = "smallest_effect: {"
WRONG = [
    # (what stands in the file, what stands there instead, where the message points, what it says)
    ("duration_min: 4", "duration_mn: 4", "duration_mn", "unknown key 'duration_mn'. Did you mean 'duration_min'?"),
    ("duration_min: 4", "duration_min: soon", "duration_min", "'soon' is not a whole number. Write a whole number."),
    ("duration_min: 4", "duration_min: 0", "duration_min", "duration_min: 0 is too small. Write 1 or more."),
    ("{rule: paper}", "{rule: papr}", "order:", "'papr' is not possible here. Use 'fixed', 'shuffled', 'latin_sq"),
    ("flow: [everything,", "flow: [evrything, everything,", "flow:", "there is no page 'evrything'"),
    ("goodbye, thanks]", "goodbye]", "flow:", "does not end with thanks"),
    ("goodbye, thanks]", "thanks]", "  goodbye:", "nobody reaches 'goodbye'"),
    ("introduction, quiz, tutorial", "introduction, tutorial", "quiz:", "the quiz is not in `flow`"),
    ("after_episode: after", "after_episode: later", "after_episode", "there is no questionnaire 'later'"),
    ("title: {en: Small, zh: 小}", "title: {en: Small}", "title:", "no words in 'zh'. Add `zh: ...`"),
    ("{name: with, predictor", "{name: without, predictor", "  - {name: without, predictor: tom", "occurs twice"),
    ("{name: with, predictor", "{name: all, predictor", "  - {name: all", "call all conditions together 'all'. Choose"),
    ("{name: stay,", "{name: all,", "  - {name: all", "reports call all agents together 'all'. Choose"),
    ("{name: matrix,", "{name: all, grid: OWN,", "  - {name: all", "call all layouts together 'all'. Choose"),
    ("name: with, predictor: tom}", "name: with, predictor: degraded}", "  - {name: with, ", "belong together"),
    ("conditions: with_predictor", "conditions: [everybody]", "{key: marks", "there is no condition 'everybody'"),
    ("correct: three", "correct: four", "    - key: onions", "'four' is none of the options. Use one of two, three"),
    ("attention: 2", "attention: 9", "{key: check", "9 is not on the scale"),
    ("type: ranking", "type: rankng", "      - key: rank", "Use 'scale', 'choice', 'multiple',"),
    ("        type: multiple\n", "", "      - key: many", "Add `type:`"),
    ("breaks: {after: [2]}", "breaks: {after: [4]}", "breaks:", "there is no break after episode 4. Use 1 to 3"),
    ("  - {name: stay, predictor: random}\n", "", "order:", "alternates two agents"),
    ("horizon: 20", "horizon: 20, deadline_ms: 300", "game:", "longer than the tick"),
    ("seed: 11\n", "seed: 11\nseed: 12\n", "seed: 12", "the key 'seed' occurs twice"),
    ("seed: 11\n", "", "name: small", "'seed' is missing here. Add `seed: ...`"),
    ("name: small", "name: Small One", "name: ", "'Small One' is not possible here. Use up to 40 lowercase"),
    ("seed: 11\n", "seed: 11\n  wrong: [\n", "  wrong", "this is not YAML"),
    ("seed: 11\n", "seed: !!python/object/apply:os.system [ls]\n", "seed: !!", "['ls'] is not a whole number"),
    ("seed: 11\n", "seed: !!binary aGk=\n", "seed: !!", "is not allowed"),
    ("seed: 11\n", "recruitment: {completed: {url: 'https://x.org/?c={cod}'}}\nseed: 1\n", "recr", "placeholder {cod}"),
    ("seed: 11\n", "recruitment: {completed: {url: 'javascript:alert(1)'}}\nseed: 1\n", "recr", "look like ^https"),
    ("- {name: stay, predictor: random}", "- {nam: stay, predictor: random}", "  - {nam:", "unknown key 'nam'"),
    ("{en: Goodbye, zh", "{en: Goodbye?, zh", "  goodbye:", "Put words that hold one of : ? , { } [ ] in quotes."),
    (FLOW, "primary: {comparison: [with, witt]}\n" + FLOW, "primary:", "comparison.1: there is no condition 'witt'"),
    (FLOW, "primary: {comparison: [with]}\n" + FLOW, "primary:", "comparison: there are too few. Write at least 2."),
    (FLOW, "primary: {comparison: [with, with]}\n" + FLOW, "primary:", "'with' occurs twice. Name each once."),
    (FLOW, PRIMARY + ", layouts: [moon]}\n" + FLOW, "primary:", "layouts.0: there is no layout 'moon'. Known: "),
    (FLOW, PRIMARY + ", agents: [moon]}\n" + FLOW, "primary:", "primary.agents.0: there is no agent 'moon'. Known: "),
    (FLOW, PRIMARY + ", measure: marks}\n" + FLOW, "primary:", "'marks' is not measured after every episode in both"),
    (FLOW, PRIMARY + ", measure: check}\n" + FLOW, "primary:", "'check' is not measured after every episode in both"),
    (FLOW, PRIMARY + ", test: chi}\n" + FLOW, "primary:", "'chi' is not possible here. Use 'welch', 'student'"),
    (FLOW, PRIMARY + ", alpha: 5}\n" + FLOW, "primary:", "primary.alpha: 5 is too large. Write less than 0.5."),
    (FLOW, PRIMARY + ", looks: [30]}\n" + FLOW, "primary:", "looks: one look alone is the final test. List two or"),
    (FLOW, PRIMARY + ", looks: [60, 30]}\n" + FLOW, "primary:", "primary.looks: the looks do not grow. List the"),
    (FLOW, PRIMARY + ", looks: [2, 30]}\n" + FLOW, "primary:", "primary.looks.0: 2 is too small. Write 4 or more."),
    (FLOW, PRIMARY + ", spending: all}\n" + FLOW, "primary:", "'all' is not possible here. Use 'obrien_fleming'"),
    (FLOW, SMALLEST + "layouts: [moon]}\n" + FLOW, "smallest_", "layouts.0: there is no layout 'moon'. Known: "),
    (FLOW, SMALLEST + "layouts: [matrix]}\n" + FLOW, "smallest_", "no effect is set. Add `reward: 5` or `answers:"),
    (FLOW, SMALLEST + "reward: 0}\n" + FLOW, "smallest_", "smallest_effect.reward: 0 is too small. Write more than"),
    ("languages: [en, zh]", "languages: []", "languages", "there are too few. Write at least 1."),
]  # fmt: skip


@pytest.mark.parametrize(("old", "new", "where", "message"), WRONG)
def test_wrong_file_is_refused_with_line_reason_and_remedy(old: str, new: str, where: str, message: str) -> None:
    text = SMALL_STUDY.replace(old, new, 1)
    assert text != SMALL_STUDY
    found = errors(text)
    expected = f"small.yaml:{line_of(where, text)}: "
    assert any(line.startswith(expected) and message.lower() in line.lower() for line in found), found


def test_all_problems_are_reported_at_once() -> None:
    text = SMALL_STUDY.replace("duration_min: 4", "duration_min: soon").replace("{rule: paper}", "{rule: none}")
    assert len(errors(text)) == 2


def test_a_last_look_beyond_the_quotas_is_refused() -> None:
    limited = SMALL_STUDY.replace("predictor: none}", "predictor: none, quota: 9}", 1)
    limited = limited.replace("{name: with, predictor: tom}", "{name: with, predictor: tom, quota: 9}")
    wrong = limited.replace(FLOW, PRIMARY + ", looks: [10, 30]}\n" + FLOW)
    assert any("the last look is at 30 people, and the quotas end at 18" in line for line in errors(wrong))
    primary = parse_study(limited.replace(FLOW, PRIMARY + ", looks: [10, 18]}\n" + FLOW)).study.primary
    assert primary is not None
    assert primary.looks == (10, 18)


def test_a_break_in_a_study_of_one_episode_is_refused_with_what_helps() -> None:
    text = Path("studies/quick_look.yaml").read_text("utf-8") + "breaks: {after: [1]}\n"
    assert "no break after episode 1. Leave `breaks.after` empty: the study has one episode." in errors(text)[0]


def test_list_with_a_wrong_item_is_not_called_empty_too() -> None:
    assert len(errors(SMALL_STUDY.replace("{name: planner, predictor", "{name: planner, predictr"))) == 1


def test_language_that_the_platform_does_not_speak_is_warned_about() -> None:
    text = SMALL_STUDY.replace("languages: [en, zh]", "languages: [en, zh, tlh]").replace("zh:", "tlh: x, zh:")
    (warning,) = parse_study(text, "small.yaml").warnings
    assert warning.startswith(
        f"small.yaml:{line_of('languages')}: languages: the platform itself has no words in 'tlh'"
    )
    assert "locales/tlh.yaml" in warning


def test_file_that_is_not_a_mapping_is_refused() -> None:
    assert "a study is a mapping" in errors("- one\n- two\n")[0]


@pytest.mark.parametrize(
    "written",
    [
        "1:30",
        "007",
        "7.50",
        "1e3",
        "0x10",
        "1_000",
        "12:30:45",
        "2026-01-01",
        "yes",
        "True",
        "off",
        ".5",
        "+49",
        ".nan",
    ],
)
def test_words_are_shown_as_they_were_written(written: str) -> None:
    text = SMALL_STUDY.replace("title: {en: Small, zh: 小}", f"title: {{en: {written}, zh: 小}}")
    assert parse_study(text).study.title.of("en") == written
    text = SMALL_STUDY.replace("title: {en: Small, zh: 小}", f"title: {written}")
    assert parse_study(text).study.title.of("zh") == written


def test_code_keeps_its_zeros() -> None:
    text = SMALL_STUDY.replace("seed: 11\n", "recruitment: {completed: {code: 001234}}\nseed: 11\n")
    assert parse_study(text).study.recruitment.completed.code == "001234"


def test_numbers_and_yes_or_no_are_read_where_the_field_wants_them() -> None:
    text = SMALL_STUDY.replace("seed: 11\n", "seed: 0011\nrecruitment: {required: true, person: P}\n")
    text = text.replace("horizon: 20", "horizon: 20, human_seat: 1, pause: {each_s: 2.50}")
    study = parse_study(text).study
    assert (study.seed, study.recruitment.required) == (11, True)
    assert (study.game.human_seat, study.game.pause.each_s) == (1, 2.5)
    assert study.recruitment.extra is None


@pytest.mark.parametrize("written", ["1:30", "0x10", "4 min", "[4]", "true"])
def test_something_that_is_not_a_plain_number_is_refused_for_a_number(written: str) -> None:
    (line,) = errors(SMALL_STUDY.replace("duration_min: 4", f"duration_min: {written}"))
    assert "is not a whole number" in line


@pytest.mark.parametrize(
    "text",
    ["a: " + "[" * 100_000, "a: " + "{b: " * 100_000, "- " * 5_000, "a: " + "[" * 30 + "]" * 30, "? " * 5_000 + "x"],
    ids=["lists", "blocks", "dashes", "closed", "keys"],
)
def test_file_that_is_nested_too_deep_is_refused_with_its_line(text: str) -> None:
    (line,) = errors("name: x\n" + text if text.startswith("a") else text)
    assert line.startswith("small.yaml:")
    assert "levels inside one another" in line


def test_file_of_too_many_values_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    assert loader.MAX_NODES == 50_000
    monkeypatch.setattr(loader, "MAX_NODES", 500)  # so many values take seconds to read
    (line,) = errors("a:\n" + "- b\n" * 600)
    assert "more than 50,000 values" in line


def test_number_with_endless_colons_is_a_text_like_any_other() -> None:
    """YAML 1.1 reads it in base 60, in a time that grows with the square of its length."""
    (line,) = errors(SMALL_STUDY.replace("duration_min: 4", "duration_min: 1" + ":1" * 200_000))
    assert "is not a whole number" in line
    assert len(line) < 200


def test_key_that_is_a_list_is_refused() -> None:
    assert "a key is a list or a block" in errors("name: x\n? [a, b]\n: c\n")[0]


def test_bomb_of_aliases_is_refused() -> None:
    rows = ["a0: &a0 [x, x, x, x, x, x, x, x, x]"]
    rows += [f"a{n}: &a{n} [{', '.join([f'*a{n - 1}'] * 9)}]" for n in range(1, 9)]
    assert "unfold to too much" in errors("\n".join(rows))[0]


def test_file_that_is_not_utf8_or_too_large_is_refused(tmp_path: Path) -> None:
    bad = tmp_path / "bad.yaml"
    bad.write_bytes(b"name: small\ntitle: \xff\n")
    with pytest.raises(StudyError, match=r"bad.yaml:2: this is not UTF-8"):
        load_study(bad)
    bad.write_bytes(b"#" * 1_000_001)
    with pytest.raises(StudyError, match="At most"):
        load_study(bad)


def test_yes_and_no_are_words_in_answers() -> None:
    text = SMALL_STUDY.replace("{value: tea, text: {en: Tea, zh: 茶}}", "{value: yes, text: {en: No, zh: Off}}")
    question = parse_study(text).study.questionnaires["everything"].questions[2]
    assert question.type == "choice"
    assert question.options[0].value == "yes"
    assert question.options[0].text.of("en") == "No"


def test_version_of_a_study_is_the_hash_of_its_file() -> None:
    assert parse_study(SMALL_STUDY).sha256 == parse_study(SMALL_STUDY).sha256
    assert parse_study(SMALL_STUDY).sha256 != parse_study(SMALL_STUDY + "# a comment\n").sha256


def test_prolific_without_a_code_is_warned_about() -> None:
    file = parse_study(SMALL_STUDY.replace("seed: 11\n", "seed: 11\nrecruitment: {source: prolific}\n"), "small.yaml")
    assert [line for line in file.warnings if "Prolific needs a fixed code" in line]
    assert file.study.recruitment.person_parameter == "PROLIFIC_PID"
    assert file.study.recruitment.extra_parameters == ("STUDY_ID", "SESSION_ID")


def test_text_falls_back_to_a_language_that_has_words() -> None:
    assert Text({"en": "Hello", "zh": "你好"}).of("zh") == "你好"
    assert Text({"en": "Hello"}).of("fr") == "Hello"
    assert Text.model_validate(7).of("fr") == "7"


def test_a_kitchen_named_as_in_overcooked_ai_has_one_name_in_the_data() -> None:
    study = parse_study(SMALL_STUDY.replace("name: coordination_ring", "name: random3")).study
    assert "counter_circuit" in {kitchen.name for kitchen in study.layouts}


def test_a_text_that_was_just_read_is_not_composed_again(monkeypatch: pytest.MonkeyPatch) -> None:
    text = SMALL_STUDY + "# nobody has read this one yet\n"
    first = parse_study(text)
    monkeypatch.delattr(loader.yaml, "compose")
    again = parse_study(text, "another name")
    assert again.study == first.study
    assert again.places.source == "another name"
