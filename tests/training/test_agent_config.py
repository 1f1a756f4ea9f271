"""Settings of agent training."""

import re
from pathlib import Path

import pytest

from training.agent_config import CONFIG_FOLDER, AgentConfig, agent_config
from training.pipeline.agent_tasks import STUDY_LAYOUTS
from training.pipeline.presets import StudyScale, load_preset, seeds
from training.predictor_config import PredictorTrainingSettings
from training.settings import ConfigError, TrainingSettings


def test_changes_on_the_command_line_come_last(tmp_path: Path) -> None:
    file = tmp_path / "mine.toml"
    file.write_text("total_timesteps = 1_000\nent_coef = 0.5\n")
    config = agent_config(file, ["total_timesteps=2_000", "network=cnn"])
    assert config == AgentConfig(total_timesteps=2000, ent_coef=0.5, network="cnn")


@pytest.mark.parametrize(
    ("change", "reason"),
    [
        ("learningrate=1", "unknown key 'learningrate'. Did you mean 'learning_rate'? Known: network, "),
        ("total_timesteps", "write it as key=value"),
        ("total_timesteps=soon", "total_timesteps is 'soon'. Write a whole number."),
        ("total_timesteps=2.5", "total_timesteps is 2.5. Write a whole number."),
        ("timesteps=-5", "total_timesteps is -5. Write a number of at least 1."),
        ("gamma=1.5", "gamma is 1.5. Write a number of at most 1."),
        ("ent_coef=true", "ent_coef is True. Write a number."),
        ("hidden=[64, 0]", "hidden.1 is 0. Write a number of at least 1."),
        ("hidden=64", "hidden is 64. Write a list, e.g. [128, 64]."),
        ("network=rnn", "network is 'rnn'. Write 'mlp' or 'cnn'."),
        ("games_per_partner=6", "Write a multiple of 4."),
    ],
)
def test_a_wrong_setting_is_refused_with_its_remedy(change: str, reason: str) -> None:
    with pytest.raises(ConfigError, match=f"^--set.*{re.escape(reason)}"):
        agent_config(None, [change])


def test_an_unknown_or_broken_file_is_refused(tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match=r"no config 'nothing'\. Known: "):
        agent_config("nothing")
    (tmp_path / "broken.toml").write_text("timesteps = = 3")
    with pytest.raises(ConfigError, match=r"broken\.toml"):
        agent_config(tmp_path / "broken.toml")


def test_differences_rebuild_the_config() -> None:
    config = agent_config(None, ["hidden=[64, 64]", "clip_coef=0.1"])
    assert config.differences() == {"hidden": [64, 64], "clip": 0.1}  # the stored names
    assert AgentConfig().changed(config.differences(), "here") == config


def test_a_setting_under_both_of_its_names_is_refused() -> None:
    with pytest.raises(ConfigError, match="clip is the former name of clip_coef, which is there too"):
        AgentConfig().changed({"clip_coef": 0.1, "clip": 0.3}, "here")


@pytest.mark.parametrize("model", [AgentConfig, PredictorTrainingSettings, StudyScale])
def test_every_setting_has_its_sentence(model: type[TrainingSettings]) -> None:
    assert [name for name, field in model.model_fields.items() if not (field.description or "").endswith(".")] == []


@pytest.mark.parametrize("path", sorted(CONFIG_FOLDER.glob("study_*.toml")), ids=lambda path: path.stem)
def test_every_preset_gives_every_run_a_config(path: Path) -> None:
    preset = load_preset(path.stem.removeprefix("study_"))
    for layout in STUDY_LAYOUTS:
        for role in ("population_sp", "target_sp", "population_fcp", "target_fcp", "features"):
            for run in seeds(role, preset):
                assert preset.config(layout, role, run).total_timesteps > 0
