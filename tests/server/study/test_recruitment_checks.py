"""What `study check` says about recruitment: nobody who worked is left without a way back."""

import re

import pytest

from server.study.drafting import changed, view
from server.study.loader import parse_study
from tests.support.study_text import SMALL_STUDY

NOBODY_SCREENED_OUT = re.sub(r"(?m)^  attempts: .*\n", "", SMALL_STUDY)
PAID = "{source: prolific, required: true, completed: {code: C1ABCDEF}"


def warnings(recruitment: str, more: str = "") -> list[str]:
    return [one.text for one in parse_study(f"{NOBODY_SCREENED_OUT}\nrecruitment: {recruitment}\n{more}").doubts]


@pytest.mark.parametrize("source", ["prolific", "mturk", "sona"])
def test_a_recruiters_link_without_an_id_is_pointed_out_and_refused_with_one_click(source: str) -> None:
    text = f"{NOBODY_SCREENED_OUT}\nrecruitment: {{source: {source}, completed: {{code: C1ABCDEF}}}}\n"
    (doubt,) = [one for one in view(text).problems if one.path == ("recruitment",)]
    assert "can take part again" in doubt.text
    assert doubt.warning
    assert doubt.mend is not None
    file = view(changed(text, dict(doubt.mend.operation))).file
    assert file is not None
    assert file.study.recruitment.required
    assert not file.doubts


def test_people_whom_prolific_pays_need_a_code_where_attention_checks_or_the_quiz_screen_them_out() -> None:
    screens = "attention: {screen_out_after: 1}"
    assert not warnings(f"{PAID}}}")
    (words,) = warnings(f"{PAID}}}", screens)
    assert "people who are screened out get no code" in words
    in_quiz = parse_study(f"{SMALL_STUDY}\nrecruitment: {PAID}}}\n").doubts
    assert [one.path for one in in_quiz] == [("recruitment",)]
    assert not warnings(f"{PAID}, screened_out: {{code: C2SCREEN}}}}", screens)
    assert not warnings("{source: sona, required: true}", screens)
