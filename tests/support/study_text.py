"""The text of the small study that tests change a line of."""

from pathlib import Path

SMALL_STUDY = (Path(__file__).parents[1] / "data" / "small_study.yaml").read_text(encoding="utf-8")
