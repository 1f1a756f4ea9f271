"""Settings of agent training."""

from dataclasses import fields, replace
from pathlib import Path

import pytest

from training.config import CONFIG_FOLDER, AgentConfig, ConfigError, agent_config, changed, differences
from training.pipeline.agent_tasks import STUDY_LAYOUTS, load_preset, seeds


def test_changes_on_the_command_line_come_last(tmp_path: Path) -> None:
    file = tmp_path / "mine.toml"
    file.write_text("timesteps = 1_000\nentropy = 0.5\n")
    config = agent_config(file, ["timesteps=2_000", "network=cnn"])
    assert config == replace(AgentConfig(), timesteps=2000, entropy=0.5, network="cnn")


@pytest.mark.parametrize(
    ("change", "reason"),
    [
        ("learningrate=1", "unknown key 'learningrate'. Known: network, "),
        ("timesteps", "write it as key=value"),
        ("timesteps=soon", "type int"),
        ("timesteps=-5", "cannot be negative"),
        ("network=rnn", "Write mlp or cnn"),
        ("games_per_partner=3", "multiple of 4"),
    ],
)
def test_a_wrong_setting_is_refused_with_its_remedy(change: str, reason: str) -> None:
    with pytest.raises(ConfigError, match=reason):
        agent_config(None, [change])


def test_an_unknown_or_broken_file_is_refused(tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match=r"no config 'nothing'\. Known: "):
        agent_config("nothing")
    (tmp_path / "broken.toml").write_text("timesteps = = 3")
    with pytest.raises(ConfigError, match=r"broken\.toml"):
        agent_config(tmp_path / "broken.toml")


def test_differences_rebuild_the_config() -> None:
    config = agent_config(None, ["hidden=[64, 64]", "clip=0.1"])
    assert differences(config) == {"hidden": [64, 64], "clip": 0.1}
    assert changed(AgentConfig(), differences(config), "here") == config


def test_every_setting_has_its_sentence() -> None:
    lines = Path(CONFIG_FOLDER.parent / "config.py").read_text().splitlines()
    for setting in fields(AgentConfig):
        (line,) = [line for line in lines if line.startswith(f"    {setting.name}: ")]
        assert "  # " in line, setting.name


@pytest.mark.parametrize("path", sorted(CONFIG_FOLDER.glob("study_*.toml")), ids=lambda path: path.stem)
def test_every_preset_gives_every_run_a_config(path: Path) -> None:
    preset = load_preset(path.stem.removeprefix("study_"))
    for layout in STUDY_LAYOUTS:
        for role in ("population_sp", "target_sp", "population_fcp", "target_fcp", "features"):
            for run in seeds(role, preset):
                assert preset.config(layout, role, run).timesteps > 0
