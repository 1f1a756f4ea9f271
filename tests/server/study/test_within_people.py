"""Factors within people: the conditions are balanced orders of blocks, and a round shows the levels of its block."""

from collections import Counter

import pytest

from server.participation.episode_specs import episode_spec, models_of
from server.study.assignment import Count, next_condition
from server.study.checks import balance
from server.study.definition import Study
from server.study.factors import arms
from server.study.loader import StudyError, parse_study
from server.study.steps import episodes_of, steps
from tests.support.study_text import SMALL_STUDY

START, END = SMALL_STUDY.index("conditions:\n"), SMALL_STUDY.index("agents:\n")
FACTORS = "factors: {prediction: [none, tom], opacity: [off, on]}\ncells: {within: [prediction], quota: 3}\n"


def study(factors: str) -> Study:
    return parse_study(SMALL_STUDY[:START] + factors + SMALL_STUDY[END:], "small.yaml").study


def test_each_condition_is_an_order_of_the_blocks() -> None:
    made = study(FACTORS)
    assert {one.name: [seen.name for seen in one.displays] for one in made.conditions} == {
        "off_order_1": ["none_off", "tom_off"],
        "off_order_2": ["tom_off", "none_off"],
        "on_order_1": ["none_on", "tom_on"],
        "on_order_2": ["tom_on", "none_on"],
    }
    assert {one.quota for one in made.conditions} == {3}
    assert made.shows_predictions(made.condition("on_order_1")), "for the introduction and the practice"
    assert [one.name for one in made.displays] == ["none_off", "tom_off", "none_on", "tom_on"]


@pytest.mark.parametrize("count", [2, 3, 4])
def test_every_combination_is_met_in_every_place_equally_often(count: int) -> None:
    levels = [f"a{number}" for number in range(count)]
    orders = [[block["a"] for block in blocks] for _, blocks in arms({"a": levels}, ["a"])]
    for place in range(count):
        assert set(Counter(order[place] for order in orders).values()) == {len(orders) // count}


def test_orders_get_the_same_number_of_people() -> None:
    made = study(FACTORS)
    held: Counter[str] = Counter()
    for number in range(12):
        held[next_condition(made, {key: Count(completed=count) for key, count in held.items()}, number)] += 1
        assert max(held.values()) - min(held[one.name] for one in made.conditions) <= 1
    assert set(held.values()) == {3}


def test_a_round_shows_what_its_block_has_and_the_practice_shows_marks() -> None:
    made = study(FACTORS)
    way = steps(made, "on_order_1", 5)
    rounds = [step for step in way if step.kind == "episode"]
    assert len(rounds) == episodes_of(made) == 8
    assert [step.block for step in rounds] == [1] * 4 + [2] * 4
    specs = [episode_spec(made, step, "on_order_1", "en") for step in rounds]
    assert [(spec.shown, spec.confidence_opacity) for spec in specs] == [("nothing", True)] * 4 + [
        ("predictor", True)
    ] * 4
    for half in (rounds[:4], rounds[4:]):
        assert {(step.layout, step.agent) for step in half} == {(step.layout, step.agent) for step in rounds}
    assert len({step.seed for step in rounds}) == 8
    tutorial = next(step for step in way if step.kind == "tutorial")
    assert episode_spec(made, tutorial, "on_order_1", "en").shown == "predictor"
    assert {step.block for step in way if step.kind == "questionnaire" and step.number} == {1, 2}


def test_the_balance_counts_the_episodes_of_all_blocks() -> None:
    for counts in balance(study(FACTORS), 12).values():
        met = [sum(count for (_, at), count in counts.items() if at == place) for place in range(8)]
        assert met == [12] * 8


def test_models_of_all_blocks_are_loaded() -> None:
    made = study("factors: {form: [window, stream]}\ncells: {within: [form]}\n")
    own = made.model_copy(update={"agents": (made.agents[0].model_copy(update={"name": "sp", "predictor": None}),)})
    names = {name for _, name in models_of(own)[1] if name.startswith("sp")}
    assert names == {"sp_predictor_window", "sp_predictor_stream"}


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        (
            "within: [prediction]",
            "within: [speed]",
            "cells.within.0: there is no factor 'speed'. Known: prediction, opac",
        ),
        (
            "within: [prediction]",
            "within: [opacity, opacity]",
            "cells.within.1: 'opacity' occurs twice. Name each once",
        ),
        (
            "quota: 3",
            "without: [none_on]",
            "cells.without: a participant meets all combinations of the levels in `withi",
        ),
        (
            "quota: 3}",
            "quota: 3}\nprimary: {comparison: [on_order_1, off_order_1]}",
            "primary.comparison: the conditions are orders of blocks: what is compared lies within people. Name an",
        ),
        (
            "quota: 3}",
            "quota: 3}\nprimary: {effect: [prediction], measure: marks}",
            "primary.measure: 'marks' is not measured after every episode in all conditions",
        ),
        (
            "prediction: [none, tom]",
            "prediction: {none: {predictor: none}, tom: {predictor: degraded}}",
            "factors.prediction.tom.predictor: in the condition tom_off, `accuracy` and `predictor: degraded` belong",
        ),
    ],
)
def test_errors_have_a_place_and_a_remedy(old: str, new: str, words: str) -> None:
    with pytest.raises(StudyError) as caught:
        study(FACTORS.replace(old, new))
    assert any(words in one for one in caught.value.lines), caught.value.lines


def test_a_primary_effect_within_people_is_accepted() -> None:
    primary = study(FACTORS + "primary: {effect: [prediction, opacity]}\n").primary
    assert primary is not None
    assert primary.effect == ("prediction", "opacity")


def test_a_smallest_effect_that_the_report_cannot_test_is_a_warning() -> None:
    """The conditions are orders of the blocks, and nobody asks whether two orders are equivalent."""
    text = SMALL_STUDY[:START] + FACTORS + "smallest_effect: {reward: 5}\n" + SMALL_STUDY[END:]
    found = [one for one in parse_study(text, "small.yaml").warnings if "smallest_effect" in one]
    assert len(found) == 1
    assert "the report tests no equivalence" in found[0]
