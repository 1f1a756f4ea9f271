"""Simulated exports for the analysis: small, seeded, written once."""

from functools import partial
from pathlib import Path

import pytest

from analysis import figure_style, study
from analysis.synthetic import Truth, write_export
from analysis.tables import Export, read_export

PLANTED = Truth(participants=16, reward_effect={"tom": 22.0}, answer_effect={"tom": 1.2}, timesteps=60, seed=7)


@pytest.fixture(scope="session")
def planted_folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """An export with a known effect of ToM predictions: 22 points and 1.2 points of the scale."""
    folder = tmp_path_factory.mktemp("planted")
    write_export(PLANTED, folder)
    return folder


@pytest.fixture(scope="session")
def planted(planted_folder: Path) -> Export:
    return read_export(planted_folder)


@pytest.fixture
def no_pictures(monkeypatch: pytest.MonkeyPatch) -> None:
    """Figures are built but not rendered, which is most of a report's time: for tests of its numbers and words."""
    monkeypatch.setattr(figure_style, "save", lambda figure, folder, name, simulated=False: "<svg></svg>")


@pytest.fixture
def quick_command(no_pictures: None, monkeypatch: pytest.MonkeyPatch) -> None:
    """`kitchenmind report` with fewer random draws and without rendering figures."""
    monkeypatch.setattr(study, "Options", partial(study.Options, power_studies=20, draws=200))
