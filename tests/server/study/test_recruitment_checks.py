"""What `study check` says about recruitment: everybody gets a code and a way back."""

import re

import pytest

from server.settings import ROOT
from server.study.drafting import changed, view
from server.study.loader import parse_study
from tests.support.study_text import SMALL_STUDY

NOBODY_SCREENED_OUT = re.sub(r"(?m)^  attempts: .*\n", "", SMALL_STUDY)
PAID = "{source: prolific, required: true, completed: {code: C1ABCDEF}"


def warnings(recruitment: str, more: str = "") -> list[str]:
    return [
        one.text for one in parse_study(f"{NOBODY_SCREENED_OUT}\nrecruitment: {recruitment}\n{more}").placed_warnings
    ]


@pytest.mark.parametrize("source", ["prolific", "mturk", "sona"])
def test_a_recruiters_link_without_an_id_is_pointed_out_and_refused_with_one_click(source: str) -> None:
    text = f"{NOBODY_SCREENED_OUT}\nrecruitment: {{source: {source}, completed: {{code: C1ABCDEF}}}}\n"
    (warning,) = [one for one in view(text).problems if one.path == ("recruitment",)]
    assert "can take part again" in warning.text
    assert warning.warning
    assert warning.fix is not None
    file = view(changed(text, dict(warning.fix.operation))).file
    assert file is not None
    assert file.study.recruitment.required
    assert not file.placed_warnings


def test_people_whom_prolific_pays_need_a_code_where_attention_checks_or_the_quiz_screen_them_out() -> None:
    screens = "attention: {screen_out_after: 1}"
    assert not warnings(f"{PAID}}}")
    (words,) = warnings(f"{PAID}}}", screens)
    assert "people who are screened out get no code" in words
    in_quiz = parse_study(f"{SMALL_STUDY}\nrecruitment: {PAID}}}\n").placed_warnings
    assert [one.path for one in in_quiz] == [("recruitment",)]
    assert not warnings(f"{PAID}, screened_out: {{code: C2SCREEN}}}}", screens)
    assert not warnings("{source: sona, required: true}", screens)


def test_people_whose_partner_does_not_come_need_a_code_that_prolific_knows() -> None:
    pairs = (ROOT / "studies" / "two_people.yaml").read_text(encoding="utf-8")
    pairs = re.sub(r"(?m)^(waiting_room|recruitment):.*\n(  .*\n)*", "", pairs)
    leaves, stays = "waiting_room: {fallback: leave}", "waiting_room: {fallback: agent}"

    def warnings(recruitment: str, waiting_room: str) -> list[str]:
        text = f"{pairs}\nrecruitment: {recruitment}\n{waiting_room}\n"
        return [one.text for one in parse_study(text).placed_warnings if "partner" in one.text]

    (words,) = warnings(f"{PAID}}}", leaves)
    assert "a code that Prolific does not know" in words
    assert not warnings(f"{PAID}}}", stays)
    assert not warnings(f"{PAID}, unpaired: {{code: C4ALONE}}}}", leaves)


def test_an_odd_quota_of_a_study_for_two_is_pointed_out_and_corrected_with_one_click() -> None:
    pairs = (ROOT / "studies" / "two_people.yaml").read_text(encoding="utf-8")
    odd = pairs.replace("{name: tom, predictor: tom}", "{name: tom, predictor: tom, quota: 45}")
    assert odd != pairs
    (warning,) = [one for one in view(odd).problems if "quota" in one.path]
    assert "of 45 people, one finds no partner" in warning.text
    assert warning.warning
    assert warning.fix is not None
    even = changed(odd, dict(warning.fix.operation))
    assert "quota: 46" in even
    assert not [one for one in view(even).problems if "quota" in one.path]
    alone = SMALL_STUDY.replace("predictor: tom}", "predictor: tom, quota: 45}", 1)
    assert not [one for one in view(alone).problems if "people" in one.text]


def test_an_odd_quota_of_all_combinations_of_levels_is_pointed_out_once() -> None:
    pairs = (ROOT / "studies" / "two_people.yaml").read_text(encoding="utf-8")
    pairs = re.sub(r"(?m)^conditions:\n(  - .*\n)*", "factors: {prediction: [none, tom]}\ncells: {quota: 45}\n", pairs)
    (warning,) = [one for one in view(pairs).problems if "quota" in one.text or "quota" in one.path]
    assert "of 45 people in each condition, one finds no partner" in warning.text
    assert warning.warning
    assert warning.path == ("cells", "quota")
    assert warning.fix is not None
    even = changed(pairs, dict(warning.fix.operation))
    assert "cells: {quota: 46}" in even
    assert not [one for one in view(even).problems if "partner" in one.text]


@pytest.mark.parametrize(
    ("pattern", "is_slow"),
    [
        ("[0-9a-f]{24}", False),
        ("(?:[A-Z]{3}-)*[0-9]+", False),
        ("[a-z]+[0-9]+", False),
        ("(([a-f0-9])+)+x", True),
        (r"(\w+-?)*", True),
        ("(a|b+)*", True),
        ("(?=(x+)+)y", True),
    ],
)
def test_a_pattern_that_could_stop_the_server_is_reported(pattern: str, is_slow: bool) -> None:
    """A wrong id of 40 letters would take hours, in which no game runs."""
    recruitment = f"recruitment: {{source: sona, required: true, person_pattern: '{pattern}'}}"
    file = parse_study(SMALL_STUDY.replace("seed: 11\n", f"seed: 11\n{recruitment}\n"))
    assert any("a repetition within a repetition" in one for one in file.warnings) is is_slow
