"""A server may be given no study file: its studies are then those that are opened in the dashboard."""

from pathlib import Path
from typing import Any

import pytest

from server.participation.served_studies import Studies
from server.participation.study_versions import StudyVersions
from server.playable_studies import playable_studies
from server.settings import Settings
from server.study.loader import StudyError, parse_study
from tests.support.study_text import SMALL_STUDY


def test_without_study_files_there_is_none_and_studies_of_the_dashboard_can_be_opened(tmp_path: Path) -> None:
    settings = Settings(data=tmp_path, database=f"sqlite:///{tmp_path}/site.db", studies=())
    assert playable_studies(settings) == []
    models: Any = None
    versions = StudyVersions(settings, [], models, Studies(), None)
    assert versions.as_opened(parse_study(SMALL_STUDY), {}).folder == Path.cwd()


def test_a_study_that_cannot_be_played_is_an_error_if_no_other_is_served(tmp_path: Path) -> None:
    file = tmp_path / "mine.yaml"
    text = SMALL_STUDY.replace("{name: planner, predictor: random}", "{name: nobody}")
    file.write_text(text, encoding="utf-8")
    settings = Settings(data=tmp_path, database=f"sqlite:///{tmp_path}/site.db", studies=(file,))
    with pytest.raises(StudyError, match="has no trained agent called 'nobody'"):
        playable_studies(settings)
