"""The text of the small study that tests change a line of."""

from pathlib import Path

SMALL_STUDY = (Path(__file__).parents[1] / "data" / "small_study.yaml").read_text(encoding="utf-8")


def study_head(name: str, title: str, seed: int = 11) -> str:
    """Return what every study file begins with, up to the consent form: the test's own text follows."""
    return f"""
name: {name}
title: {{en: {title}}}
summary: {{en: For tests.}}
languages: [en]
seed: {seed}
duration_min: 1
consent:
  title: {{en: Take part}}
  lead: {{en: A test.}}
  sections: [{{title: {{en: What happens}}, body: {{en: You play.}}}}]
  boxes: [{{en: I agree.}}]"""


BRANCHED = SMALL_STUDY
"""SMALL_STUDY with a page and a questionnaire that depend on the first page's answers, one of its questions too."""
for _old, _new in (
    ("flow: [everything, introduction,", "flow: [everything, more, introduction,"),
    ("  goodbye: {title", "  goodbye: {when: {question: pick, one_of: [milk]}, title"),
    (
        "  after:\n",
        """  more:
    title: {en: More, zh: 更多}
    when: {question: mood, one_of: [6, 7]}
    questions:
      - key: sweet
        type: choice
        text: {en: Sweet, zh: 甜}
        options: [{value: yes, text: {en: Yes, zh: 是}}, {value: no, text: {en: No, zh: 否}}]
      - key: sugar
        type: choice
        when: {question: pick, one_of: [milk]}
        text: {en: How much sugar, zh: 多少糖}
        options: [{value: little, text: {en: Little, zh: 少}}, {value: much, text: {en: Much, zh: 多}}]
  after:
""",
    ),
):
    assert _old in BRANCHED
    BRANCHED = BRANCHED.replace(_old, _new, 1)
