"""The pages of everything that a study file may contain, and the examples of its keys from the study files."""

import json
from functools import cache
from pathlib import Path
from typing import Any, Final

import yaml

from server.study.reference import QUESTION, TEXT, TOP, StudyReference, inner_block, is_question, mappings
from server.study.schema import study_schema
from server.study.sections import StudySection

ROOT: Final = Path(__file__).resolve().parents[2]
# The study files that the examples come from, in this order.
EXAMPLES: Final = (
    "tests/data/every_setting.yaml",
    "studies/two_people.yaml",
    "studies/external_predictor.yaml",
    "studies/examples/on_demand.yaml",
    "studies/examples/limited_sight.yaml",
    "studies/examples/misleading_marks.yaml",
    "studies/examples/two_factors.yaml",
)
HEAD: Final = """# Study keys

Everything that a study file may contain, a page for each section. The study builder has the same sections and links to
these pages. `kitchenmind study new NAME` makes a file to start from, and `kitchenmind study check FILE` names every
mistake with its line. An unknown key is an error. The examples come from the repository's study files.

A *text* is what participants read: one text for all languages, or a mapping by language such as `{en: Age, zh: 年龄}`.

`python -m docs.generate` writes these pages from `server/study`.

| section | keys |
|---|---|
"""

Block = dict[str, Any]


def study_keys() -> str:
    """Return the page that leads to the sections."""
    return HEAD + _reference().contents()


def section_page(section: StudySection) -> str:
    """Return the page of a section."""
    return (
        f"# {section.title}\n\nKeys at the top of a [study file](../study_keys.md).\n\n{_reference().tables(section)}"
    )


def key_examples() -> str:
    """Return the first value of each key in the study files, by block and key, as JSON."""
    return json.dumps(_Examples(study_schema()).found, ensure_ascii=False, indent=1, sort_keys=True) + "\n"


@cache
def _reference() -> StudyReference:
    schema = study_schema()
    return StudyReference(schema, _Examples(schema).found)


class _Examples:
    """The first plain value of each key, by block and key."""

    def __init__(self, schema: Block) -> None:
        self.blocks: dict[str, Block] = schema["$defs"]
        self.found: dict[str, dict[str, Any]] = {}
        self.questions = {
            block["properties"]["type"]["const"]: name for name, block in self.blocks.items() if is_question(block)
        }
        for name in EXAMPLES:
            self._collect(yaml.load((ROOT / name).read_text(encoding="utf-8"), _BooleanReader), schema, TOP)  # noqa: S506 a safe loader

    def _collect(self, value: Any, block: Block, name: str) -> None:
        for key, inner in value.items():
            target = inner_block(block["properties"][key])
            if target in (None, TEXT):
                self.found.setdefault(name, {}).setdefault(key, inner)
                continue
            parts = inner if isinstance(inner, list) else [inner]
            for _ in mappings(block["properties"][key]):
                parts = [entry for part in parts if isinstance(part, dict) for entry in part.values()]
            for part in parts:
                kind = self.questions[part["type"]] if target == QUESTION else str(target)
                self._collect(part, self.blocks[kind], kind)


class _BooleanReader(yaml.SafeLoader):
    """Reads only true and false as booleans, like the loader of study files: No is a word."""

    yaml_implicit_resolvers = {  # noqa: RUF012 a copy of the base class's
        first: [pair for pair in pairs if pair[0] != "tag:yaml.org,2002:bool" or first in "tf"]
        for first, pairs in yaml.SafeLoader.yaml_implicit_resolvers.items()
    }
