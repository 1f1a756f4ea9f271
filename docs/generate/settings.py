"""The page of the `KITCHENMIND_*` variables, from `server/settings.py`."""

import json
from pathlib import Path
from typing import Any, Final

from kitchenmind.argument_parser import ExactArgumentParser
from server.commands import serve
from server.settings import Settings
from server.study.markdown_table import cell, code, plain_type
from server.study.schema import descriptions

ROOT: Final = Path(__file__).resolve().parents[2]


def settings() -> str:
    """Return the page of the `KITCHENMIND_*` variables."""
    parser = ExactArgumentParser()
    serve.add_arguments(parser)
    options = {action.dest: action.option_strings[0] for action in parser._actions if action.option_strings}
    options = {"studies": options["study"]} | {name: flag for name, flag in options.items() if name != "speed"}
    sentences = descriptions(Settings)
    lines = [HEAD]
    for name, field in Settings.model_fields.items():
        schema = Settings.model_json_schema()["properties"][name]
        row = (
            f"`KITCHENMIND_{name.upper()}`",
            _type(schema),
            _setting_default(field.default),
            f"`{options[name]}`" if name in options else "",
            cell(sentences[name]),
        )
        lines.append(f"| {' | '.join(row)} |\n")
    return "".join(lines)


HEAD: Final = """# Settings

The server reads its settings from the environment, or from a file `.env` in the folder in which it starts. Options of
`kitchenmind serve` take precedence, and an empty variable leaves a setting at its default. Every default is right for
your own machine. With `KITCHENMIND_MODE=production`, the server refuses to start with unsafe settings. `kitchenmind
doctor` checks them.

`python -m docs.generate` writes this page from `server/settings.py`.

| variable | type | default | option | meaning |
|---|---|---|---|---|
"""


def _setting_default(value: object) -> str:
    if value is None or value == "":
        return "empty"
    if isinstance(value, tuple):
        return code(json.dumps([str(path.relative_to(ROOT)) for path in value]))
    return code(str(value).replace(str(ROOT / "var"), "var"))


def _type(value: dict[str, Any]) -> str:
    kinds = [kind for kind in value.get("anyOf", [value]) if kind != {"type": "null"}]
    return " or ".join(f"list of {_type(kind['items'])}" if "items" in kind else plain_type(kind) for kind in kinds)
