"""Published scales by name: what is asked, in which order, and what is refused."""

from pathlib import Path

import pytest

from server.study.answer_checks import check_answers
from server.study.loader import StudyError, parse_study
from server.study.published_scales import SCALE_NAMES, SCALES, published_scale, scale_languages
from server.study.questionnaire import AnyQuestion, ScaleQuestion
from tests.support.study_text import SMALL_STUDY

ENTRY = "      - {key: words, type: text"  # a line of the small study, before which a scale is put


def small_with(entry: str, study: str = SMALL_STUDY) -> str:
    return study.replace(ENTRY, f"      - {entry}\n{ENTRY}")


def asked(entry: str) -> tuple[AnyQuestion, ...]:
    return parse_study(small_with(entry)).study.questions("everything")


def test_every_scale_has_a_name_that_a_study_can_use() -> None:
    assert sorted(SCALE_NAMES) == sorted(path.stem for path in SCALES.glob("*.yaml"))


@pytest.mark.parametrize("name", SCALE_NAMES)
def test_a_scale_names_source_and_licence_and_how_its_translations_were_made(name: str) -> None:
    said = published_scale(name)
    assert said["source"]
    assert said["licence"]
    assert said["url"].startswith("https://")
    assert scale_languages(name) == ("en", "zh")
    assert set(said["translations"]) == {"zh"}
    assert {item["subscale"] for item in said["items"]} == set(said["subscales"])
    for item in said["items"]:
        assert set(item["text"]) == {"en", "zh"}
    assert len(said.get("labels", ())) in (0, said["points"])


def test_no_two_items_have_the_same_key() -> None:
    keys = [item["key"] for name in SCALE_NAMES for item in published_scale(name)["items"]]
    assert len(set(keys)) == len(keys)


def test_items_stand_where_the_scale_is_named_in_the_original_order() -> None:
    keys = [question.key for question in asked("{type: published, scale: nasa_tlx_raw}")]
    tlx = ["mental_demand", "physical_demand", "temporal_demand", "performance", "effort", "frustration"]
    assert keys == ["mood", "check", "pick", "many", *(f"tlx_{each}" for each in tlx), "words", "years", "rank"]
    performance = asked("{type: published, scale: nasa_tlx_raw}")[7]
    assert isinstance(performance, ScaleQuestion)
    assert (performance.low.of("en"), performance.high.of("en")) == ("Perfect", "Failure")


def test_subscales_are_asked_alone_and_keep_the_order_of_the_whole() -> None:
    found = asked("{type: published, scale: trust_in_automation, subscales: [trust, familiarity], required: false}")
    chosen = [question for question in found if question.key.startswith("tia_")]
    assert [question.key for question in chosen] == ["tia_f1", "tia_t1", "tia_t2", "tia_f2"]
    assert not any(question.required for question in chosen)
    assert [each.of("en") for each in chosen[0].labels][::4] == ["Strongly disagree", "Strongly agree"]  # type: ignore[union-attr]


@pytest.mark.parametrize(("given", "taken"), [("0", True), ("95", True), ("100", True), ("7", False), ("105", False)])
def test_workload_is_answered_from_0_to_100_in_steps_of_5(given: str, taken: bool) -> None:
    effort = tuple(one for one in asked("{type: published, scale: nasa_tlx_raw}") if one.key == "tlx_effort")
    checked = check_answers(effort, {"tlx_effort": [given]})
    assert checked.answers == ({"tlx_effort": int(given)} if taken else {})
    assert [fault.numbers for fault in checked.faults.values()] == ([] if taken else [{"low": 0, "high": 100}])


@pytest.mark.parametrize(
    ("entry", "reason"),
    [
        ("{type: published, scale: nasa_tlx}", "scale: 'nasa_tlx' is not possible here. Use 'nasa_tlx_raw' or 'trust_"),
        (
            "{type: published, scale: nasa_tlx_raw, subscales: [effort]}",
            "nasa_tlx_raw has no 'effort'. Use some of wor",
        ),
        ("{key: mood2, type: scale, points: 3, labels: [a, b], text: M, low: 1, high: 3}", "there are 2 for 3 points"),
        (
            "{key: mood2, type: scale, first: 0, attention: 7, text: M, low: 1, high: 3}",
            "is not on the scale. Use 0 to",
        ),
        ("{type: published, scale: nasa_tlx_raw, conditions: [nobody]}", "there is no condition 'nobody'"),
    ],
)
def test_an_impossible_question_is_refused_with_the_possible_ones(entry: str, reason: str) -> None:
    with pytest.raises(StudyError, match=r"study.yaml:\d+: questionnaires.everything.questions.4") as refused:
        parse_study(small_with(entry))
    assert reason in str(refused.value)


def test_a_scale_without_words_in_a_language_of_the_study_is_refused() -> None:
    study = SMALL_STUDY.replace("languages: [en, zh]", "languages: [en, de]").replace("zh: ", "de: ")
    with pytest.raises(StudyError, match=r"questions.4.scale: nasa_tlx_raw has no words in 'de'. Write its items out"):
        parse_study(small_with("{type: published, scale: nasa_tlx_raw}", study))


def test_an_item_does_not_come_twice_on_a_page() -> None:
    own = "{key: tlx_effort, type: scale, text: {en: E, zh: E}, low: 1, high: 7}\n      - "
    with pytest.raises(StudyError, match="'tlx_effort' occurs twice"):
        parse_study(small_with(own + "{type: published, scale: nasa_tlx_raw}"))


def test_the_example_asks_what_people_think_of_the_marks() -> None:
    path = Path(__file__).parents[3] / "studies" / "examples" / "misleading_marks.yaml"
    study = parse_study(path.read_text("utf-8")).study
    assert len(study.questions("trust")) == 12
    assert study.flow.index("trust") < study.flow.index("purpose"), "asked before people are told"
