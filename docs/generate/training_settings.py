"""The page of the settings of training, from the models in `training`."""

import json
from typing import Any, Final

from server.study.markdown_table import cell, code, plain_type
from training.agent_config import AgentConfig
from training.pipeline.presets import StudyScale
from training.predictor_config import IntentionSettings, NetworkSettings, TrainingConfig
from training.settings import TrainingSettings

HEAD: Final = """# Training settings

What `--set KEY=VALUE`, the TOML files in `training/configs` and presets of `kitchenmind train study` can change
([command line](command_line.md)). Settings of PPO have the names that
[CleanRL](https://docs.cleanrl.dev/rl-algorithms/ppo/) uses. An unknown key or a wrong value is an error that names the
place and the fix. The folder of a run is named by the settings that differ from the defaults.

Where a column *stored as* has a name, run folders, task keys and checkpoints use that name, and it is also accepted.

`python -m docs.generate` writes this page from `training`.
"""
PRESET: Final = """
`[ROLE]` changes a role in every kitchen, `[layout.NAME.ROLE]` in one kitchen, and `[population_sp_1]` one run. The
roles are `population_sp`, `target_sp`, `population_fcp`, `target_fcp` and `features` (the agent with the pretrained
encoder). `auxiliary_partners` in `[layout.NAME]` is the number of further SP agents (and half as many FCP agents) that
only predictors train with. With `stream_extras = true` there, the stream form alone trains with partners that the paper
does not have. `[predictor]` changes all predictors, `[predictor.window]` one form.
`like = "coordination_ring"` in `[layout.NAME]` gives a kitchen all tables of another one; its own come on top.
"""
PARTS: Final[tuple[tuple[type[TrainingSettings], str, str], ...]] = (
    (AgentConfig, "Agent", "`kitchenmind train agent --set`, `--config`, and the tables of roles in a preset."),
    (NetworkSettings, "Network of a predictor", "`kitchenmind train predictor --set` and `[predictor]` in a preset."),
    (TrainingConfig, "Training of a predictor", "`kitchenmind train predictor --set` and `[predictor]` in a preset."),
    (
        IntentionSettings,
        "Intentions of a predictor",
        "`kitchenmind train intentions --set`. It learns after each predictor, from the same games.",
    ),
    (StudyScale, "Scale of a study", "At the top of a preset of `kitchenmind train study --preset FILE.toml`."),
)


def training_settings() -> str:
    """Return the page of all settings of training."""
    return HEAD + "".join(_part(*part) for part in PARTS) + PRESET


def _part(model: type[TrainingSettings], title: str, place: str) -> str:
    schema = model.model_json_schema(by_alias=False)
    rows = [_row(name, value, model, schema) for name, value in schema["properties"].items()]
    head = "| key | type | default | stored as | meaning |\n|---|---|---|---|---|\n"
    return f"\n## {title}\n\n{place}\n\n{head}{''.join(rows)}"


def _row(name: str, value: dict[str, Any], model: type[TrainingSettings], schema: dict[str, Any]) -> str:
    kind = f"list of {plain_type(value['items'])}" if "items" in value else plain_type(value)
    if "multipleOf" in value:
        kind += f", a multiple of {value['multipleOf']}"
    default = "required" if name in schema.get("required", ()) else code(_written(value["default"]))
    stored = code(model.model_fields[name].serialization_alias or "")
    return f"| `{name}` | {kind} | {default} | {stored} | {cell(value['description'])} |\n"


def _written(value: Any) -> str:
    """Return a default as TOML has it, without digit groups."""
    return value if isinstance(value, str) else json.dumps(value)
