"""Factors of a study file: every combination of levels is a condition, and problems are reported with their place."""

import json
import re
from collections import Counter
from pathlib import Path

import pytest

from server.participation.episode_specs import episode_spec, models_of
from server.study.assignment import Count, next_condition
from server.study.definition import Study
from server.study.factors import SETTING_OF
from server.study.loader import StudyError, StudyFile, parse_study
from server.study.steps import steps
from tests.support.study_text import SMALL_STUDY

START, END = SMALL_STUDY.index("conditions:\n"), SMALL_STUDY.index("agents:\n")
CONDITIONS = SMALL_STUDY[START:END]
NAMED = "factors: {prediction: [random, tom], opacity: [off, on]}\n"
EIGHT = ", ".join(f"a{number}: {{}}" for number in range(8))
BLOCKS = """factors:
  display:
    one: {steps_shown: 1, show: on_key}
    three: {predictor: random, steps_shown: 3}
  sight:
    near: {view_radius: 2}
    far: {}
"""


def file(factors: str) -> StudyFile:
    return parse_study(SMALL_STUDY[:START] + factors + SMALL_STUDY[END:], "small.yaml")


def study(factors: str) -> Study:
    return file(factors).study


def test_named_levels_are_crossed_with_equal_weights() -> None:
    conditions = study(NAMED).conditions
    assert [(one.name, one.predictor, one.confidence_opacity) for one in conditions] == [
        ("random_off", "random", False),
        ("random_on", "random", True),
        ("tom_off", "tom", False),
        ("tom_on", "tom", True),
    ]
    assert {(one.weight, one.quota) for one in conditions} == {(1, None)}


def test_levels_set_what_they_have_and_leave_the_rest() -> None:
    found = {one.name: one for one in study(BLOCKS).conditions}
    assert list(found) == ["one_near", "one_far", "three_near", "three_far"]
    near = found["one_near"]
    assert (near.predictor, near.steps_shown, near.show, near.view_radius) == ("tom", 1, "on_key", 2)
    far = found["three_far"]
    assert (far.predictor, far.steps_shown, far.show, far.view_radius) == ("random", 3, None, None)


def test_three_factors_make_eight_conditions() -> None:
    conditions = study(NAMED.replace("]}", "], steps: {one: {steps_shown: 1}, two: {steps_shown: 2}}}")).conditions
    assert len({one.name for one in conditions}) == 8
    assert conditions[0].name == "random_off_one"


def test_cells_get_the_same_number_of_people() -> None:
    made = study(NAMED + "cells: {quota: 5}\n")
    held: Counter[str] = Counter()
    for number in range(20):
        name = next_condition(made, {key: Count(completed=count) for key, count in held.items()}, number)
        held[name] += 1
        assert max(held.values()) - min(held[one.name] for one in made.conditions) <= 1
    assert set(held.values()) == {5}


def test_a_combination_can_be_left_out() -> None:
    made = study("factors: {prediction: [none, tom], opacity: [off, on]}\ncells: {without: [none_on]}\n")
    assert [one.name for one in made.conditions] == ["none_off", "tom_off", "tom_on"]


def test_levels_that_change_the_same_are_warned_about() -> None:
    (warning,) = file("factors: {prediction: {none: {}, tom: {}}}\n").warnings
    assert "factors.prediction.tom: the levels 'none' and 'tom' change nothing: participants see the same" in warning
    assert "Give 'tom' a setting, such as `predictor: none`." in warning
    (same,) = file("factors: {sight: {far: {}, near: {view_radius: 2}, close: {view_radius: 2}}}\n").warnings
    assert "the levels 'near' and 'close' change the same" in same


def test_a_combination_without_effect_is_allowed_and_warned_about() -> None:
    (warning,) = file("factors: {prediction: [none, tom], opacity: [off, on]}\n").warnings
    assert warning.startswith(f"small.yaml:{SMALL_STUDY[:START].count(chr(10)) + 1}: factors.opacity: in the condition")
    assert "`confidence_opacity: true` in a condition without marks has no effect. Keep it for a full" in warning
    assert "cells: {without: [none_on]}" in warning


def test_every_display_setting_reaches_the_game_of_its_condition() -> None:
    made = study(BLOCKS.replace("{predictor: random,", "{form: window, confidence_opacity: true,"))
    specs = {}
    for condition in made.conditions:
        step = next(step for step in steps(made, condition.name, 5) if step.kind == "episode")
        specs[condition.name] = episode_spec(made, step, condition.name, "en")
    one, three = specs["one_near"], specs["three_far"]
    assert (one.steps_shown, one.confidence_opacity, one.show, one.view_radius) == (1, False, "on_key", 2)
    assert (three.steps_shown, three.confidence_opacity, three.show, three.view_radius) == (3, True, "always", 0)


def test_the_form_of_a_condition_chooses_its_predictor() -> None:
    made = study("conditions:\n  - {name: a, predictor: tom, form: window}\n  - {name: b, predictor: tom}\n")
    agents = made.model_copy(update={"agents": (made.agents[0].model_copy(update={"name": "sp", "predictor": None}),)})
    names = {name for _, name in models_of(agents)[1] if name.startswith("sp")}
    assert names == {"sp_predictor_window", "sp_predictor_stream"}


@pytest.mark.parametrize(
    ("factors", "line", "words"),
    [
        (NAMED + CONDITIONS, "conditions:", "`factors` already make the conditions. Remove `conditions`, or remove"),
        ("", "", "'conditions' is missing here. Add `conditions: ...`."),
        ("factors: {}\n", "", "'conditions' is missing here"),
        ("factors: {speed: [slow, fast]}\n", "factors:", "these levels change no setting: slow, fast. Write"),
        ("factors: {opacity: [off, off]}\n", "factors:", "these levels change no setting: off, off"),
        ("factors: {opacity: [on]}\n", "factors:", "factors.opacity: there are too few. Write at least 2."),
        ("factors: [prediction, opacity]\n", "factors:", "factors: this is not a block."),
        ("factors: {opacity: [off, dim]}\n", "factors:", "'dim' is neither true nor false"),
        (BLOCKS.replace("on_key", "on_kee"), "    one:", "factors.display.one.show: 'on_kee' is not possible here"),
        (BLOCKS.replace("show:", "shw:"), "    one:", "unknown key 'shw'. Did you mean 'show'?"),
        (BLOCKS.replace("{}", "{quota: 3}"), "    far:", "unknown key 'quota'"),
        (
            BLOCKS.replace("{}", "{steps_shown: 2}"),
            "    far:",
            "factors.sight.far.steps_shown: `steps_shown` is set by the factors 'display' and 'sight'. Set it in the",
        ),
        (
            BLOCKS.replace("predictor: random", "predictor: degraded"),
            "    three:",
            "factors.display.three.predictor: in the condition three_near, `accuracy` and `predictor: degraded` belong",
        ),
        (
            NAMED + "cells: {without: [tom_of]}\n",
            "cells:",
            "cells.without.0: no combination of levels is named 'tom_of'",
        ),
        (
            NAMED + "cells: {without: [random_off, random_on, tom_off, tom_on]}\n",
            "factors:",
            "factors: `without` leaves no condition. Leave fewer out.",
        ),
        ("cells: {quota: 3}\n" + CONDITIONS, "cells:", "`cells` has no effect without `factors`. Add `factors`, or"),
        (
            "factors: {a: {x: {}, x_y: {}}, b: {y_z: {}, z: {}}}\n",
            "factors:",
            "'x_y_z' occurs twice",
        ),
        (
            f"factors: {{a: {{{'x' * 30}: {{}}, y: {{}}}}, b: {{{'z' * 30}: {{}}, z: {{}}}}}}\n",
            "factors:",
            "has more than 40 characters. Use shorter names of levels.",
        ),
        (
            f"factors: {{a: {{{EIGHT}}}, b: {{v: {{}}, w: {{}}, x: {{}}, y: {{}}, z: {{}}}}}}\n",
            "factors:",
            "the levels have 40 combinations. Use factors with at most 32.",
        ),
        (
            NAMED + "primary: {effect: [speed]}\n",
            "primary:",
            "primary.effect.0: there is no factor 'speed'. Known: pred",
        ),
        (
            NAMED + "primary: {effect: [opacity, opacity]}\n",
            "primary:",
            "effect.1: 'opacity' occurs twice. Name each",
        ),
        (
            NAMED + "primary: {test: welch}\n",
            "primary:",
            "it has neither `comparison` nor `effect`. Write either `comparison: [A",
        ),
        (
            NAMED + "primary: {effect: [opacity], comparison: [tom_on, tom_off]}\n",
            "primary:",
            "primary: it names both two conditions and an effect. Write either",
        ),
        (NAMED + "primary: {effect: [opacity], test: welch}\n", "primary:", "test: an effect of factors has no welch."),
        (NAMED + "primary: {effect: [opacity], looks: [9, 20]}\n", "primary:", "looks: an effect of factors is tested"),
        (
            NAMED + "primary: {comparison: [tom_on, tom_off], test: anova}\n",
            "primary:",
            "primary.test: `anova` tests an effect of factors, not two conditions. Use welch,",
        ),
        (
            NAMED + "cells: {without: [random_on]}\nprimary: {effect: [opacity]}\n",
            "primary:",
            "primary.effect: effects cannot be separated, as the study leaves out random_on. Remove `cells.without`",
        ),
        (
            "factors: {prediction: [none, random, tom]}\nprimary: {effect: [prediction], direction: less}\n",
            "primary:",
            "primary.direction: an effect of prediction, which has more than two levels, has no direction. Remove",
        ),
        (NAMED + "primary: {effect: [opacity], measure: check}\n", "primary:", "after every episode in all conditions"),
    ],
)
def test_errors_have_a_place_and_a_remedy(factors: str, line: str, words: str) -> None:
    text = SMALL_STUDY[:START] + factors + SMALL_STUDY[END:]
    with pytest.raises(StudyError) as caught:
        parse_study(text, "small.yaml")
    number = next((n for n, row in enumerate(text.split("\n"), start=1) if line and row.startswith(line)), None)
    assert any(words in one for one in caught.value.lines), caught.value.lines
    assert len(caught.value.lines) == 1 or "degraded" in words
    assert number is None or caught.value.lines[0].startswith(f"small.yaml:{number}: "), caught.value.lines


def test_the_study_builder_has_the_same_short_names_of_settings():
    script = Path("static/js/admin/builder-items.js").read_text("utf-8")
    (names,) = re.findall(r"const SETTINGS = (\{[^}]+\})", script)
    assert json.loads(re.sub(r"(\w+):", r'"\1":', names).replace("'", '"')) == SETTING_OF
