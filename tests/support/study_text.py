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
