"""The reference of study files, from their JSON schema: tables in Markdown for each section."""

import json
from collections.abc import Iterator, Mapping, Sequence
from functools import cache
from pathlib import Path
from typing import Any, Final

import yaml

from server.study.markdown_table import cell, code, plain_type
from server.study.schema import study_schema
from server.study.sections import SECTIONS, StudySection

EXAMPLES_FILE: Final = Path(__file__).with_name("key_examples.json")  # written by `python -m docs.generate`
TEXT: Final = "Text"  # the type of what participants read, by language
QUESTION: Final = "SurveyQuestion"
QUESTIONS: Final = "questionnaires"  # the section that has them
IN_QUESTIONS: Final = "questions."  # before the keys of blocks inside a question
TOP: Final = ""  # the block of the keys at the top of the file
TABLE: Final = "| key | type | default | example | meaning |\n|---|---|---|---|---|\n"

Block = dict[str, Any]
Examples = Mapping[str, Mapping[str, Any]]  # by block and key


class StudyReference:
    """The schema of a study file, with where each block is used and an example for each key."""

    def __init__(self, schema: Block, examples: Examples) -> None:
        self.schema = schema
        self.examples = examples
        self.blocks: dict[str, Block] = schema["$defs"]
        self.questions = [name for name, block in self.blocks.items() if is_question(block)]
        self.places = self._places()
        self.sections = {key: section for section in SECTIONS for key in section.keys}

    def contents(self) -> str:
        """Return the rows of a table of all sections: a link to the page, and its keys."""
        return "".join(
            f"| [{section.title}](study_keys/{section.name}.md) | {', '.join(map(code, section.keys))} |\n"
            for section in SECTIONS
        )

    def tables(self, section: StudySection) -> str:
        """Return a section's keys, then the blocks inside them."""
        return "".join(self._lines(section))

    def _lines(self, section: StudySection) -> Iterator[str]:
        yield from self._table(section, _only(self.schema, set(section.keys)), TOP)
        here = [name for name in self.places if self._section_of(name) is section]
        in_questions = [name for name in here if self.places[name][0].startswith(IN_QUESTIONS)]
        for name in here:
            if name not in in_questions:
                yield from self._block(section, name)
        if section.name == QUESTIONS:
            yield from self._questions(section)
        for name in in_questions:
            yield from self._block(section, name)

    def _section_of(self, block: str) -> StudySection:
        place = self.places[block][0]
        return self.sections[QUESTIONS if place.startswith(IN_QUESTIONS) else place.partition(".")[0]]

    def _block(self, section: StudySection, name: str) -> Iterator[str]:
        first, *others = self.places[name]
        yield f"\n## {_title(first)}\n\n{_summary(self.blocks[name])}"
        if others:
            yield f" Also used for {', '.join(_title(place) for place in others)}."
        yield "\n\n"
        yield from self._table(section, self.blocks[name], name)

    def _questions(self, section: StudySection) -> Iterator[str]:
        """Yield the keys that all types of questions share once, then those of each type."""
        asking = [name for name in self.questions if "key" in self.blocks[name]["properties"]]
        shared = set.intersection(*(set(self.blocks[name]["properties"]) for name in asking)) - {"type"}
        yield "\n## Questions\n\nEvery question has a `type` and, unless it is `published`, these keys:\n\n"
        yield from self._table(section, _only(self.blocks[asking[0]], shared), QUESTION)
        for name in self.questions:
            block = self.blocks[name]
            yield f"\n### type: {block['properties']['type']['const']}\n\n{_summary(block)}\n\n"
            left_out = {"type", *(shared if name in asking else ())}
            yield from self._table(section, _only(block, block["properties"].keys() - left_out), name)

    def _table(self, section: StudySection, block: Block, name: str) -> Iterator[str]:
        """Yield a row for each key of a block."""
        yield TABLE
        for key, value in block["properties"].items():
            inner = inner_block(value)
            is_block = inner not in (None, TEXT)
            default = "required" if key in block.get("required", ()) else _default(value, is_block)
            example = "" if is_block else code(_flow(self._example(name, key, value)))
            meaning = value.get("description") or _summary(self.blocks[str(inner)])
            yield f"| `{key}` | {self._type(section, value)} | {default} | {example} | {cell(meaning)} |\n"

    def _example(self, name: str, key: str, value: Block) -> Any:
        """Return a value from a study file, or one that the schema gives. Questions share the keys of all types."""
        blocks = self.questions if name == QUESTION else [name]
        there = [self.examples[block][key] for block in blocks if key in self.examples.get(block, {})]
        return there[0] if there else value.get("examples", [None])[0]

    def _type(self, section: StudySection, value: Block) -> str:
        """Return a type in words; a block is a link to its table."""
        if "$ref" in value:
            name = str(value["$ref"]).rpartition("/")[2]
            return "text" if name == TEXT else f"[block]({self._link(section, name)})"
        if "oneOf" in value:
            return f"[question]({'' if section.name == QUESTIONS else QUESTIONS + '.md'}#questions)"
        if "anyOf" in value:
            kinds = [self._type(section, kind) for kind in value["anyOf"] if kind != {"type": "null"}]
            return " or ".join(dict.fromkeys(kinds))
        if "items" in value:
            return f"list of {self._type(section, value['items'])}"
        mapped = _mapped(value)
        return f"mapping of a name to a {self._type(section, mapped)}" if mapped else plain_type(value)

    def _link(self, section: StudySection, block: str) -> str:
        there = self._section_of(block)
        return f"{'' if there is section else there.name + '.md'}#{anchor(self.places[block][0])}"

    def _places(self) -> dict[str, list[str]]:
        """Return, for each block, the keys that hold it, from the top of the file down."""
        found: dict[str, list[str]] = {}
        waiting = [("", self.schema)]
        while waiting:
            prefix, block = waiting.pop(0)
            for key, value in block.get("properties", {}).items():
                name = inner_block(value)
                if name in (None, TEXT, QUESTION):
                    continue
                place = f"{prefix}{key}{'.NAME' * len(mappings(value))}"
                if name not in found:
                    waiting.append((f"{place}.", self.blocks[str(name)]))
                found.setdefault(str(name), []).append(place)
        for question in self.questions:
            for key, value in self.blocks[question]["properties"].items():
                name = inner_block(value)
                if name not in (None, TEXT):
                    found.setdefault(str(name), [f"{IN_QUESTIONS}{key}"])
        return found


@cache
def study_reference() -> StudyReference:
    """Return the reference, with the stored examples."""
    return StudyReference(study_schema(), json.loads(EXAMPLES_FILE.read_text(encoding="utf-8")))


def anchor(place: str) -> str:
    """Return the anchor of a heading, the same on the website and on GitHub."""
    return "".join(each for each in place.lower() if each.isalnum() or each in "_-" or each == " ").replace(" ", "-")


def _title(place: str) -> str:
    return f"`{place}`"


def _summary(block: Block) -> str:
    return cell(str(block.get("description", "")).split("\n\n")[0])


def is_question(block: Block) -> bool:
    return "const" in block.get("properties", {}).get("type", {})


def _only(block: Block, keys: Sequence[str] | set[str]) -> Block:
    return block | {"properties": {key: value for key, value in block["properties"].items() if key in keys}}


def _default(value: Block, is_block: bool) -> str:
    default = value.get("default")
    if is_block and isinstance(default, dict):
        return "its defaults"
    return "empty" if default in (None, [], {}) else code(_flow(default))


def _flow(value: Any) -> str:
    """Return a value as one line of YAML."""
    if value is None:
        return ""
    as_json = json.dumps(value, ensure_ascii=False)
    if "\\n" in as_json:
        return as_json
    text = yaml.safe_dump(value, default_flow_style=True, allow_unicode=True, width=10_000, sort_keys=False)
    return text.removesuffix("\n").removesuffix("\n...")


def _mapped(value: Block) -> Block | None:
    """Return the type of a mapping's values, None for anything else."""
    for values in (value.get("additionalProperties"), *value.get("patternProperties", {}).values()):
        if isinstance(values, dict):
            return values
    return None


def mappings(value: Block) -> list[Block]:
    """Return the types of the values of a mapping and of the mappings inside it."""
    held = [value, *value.get("anyOf", ())]
    mapped = next(filter(None, map(_mapped, held)), None)
    return [mapped, *mappings(mapped)] if mapped else []


def inner_block(value: Block) -> str | None:
    """Return the name of the block inside a key, SurveyQuestion for a question of any type, None for a plain value."""
    if "$ref" in value:
        return str(value["$ref"]).rpartition("/")[2]
    if "oneOf" in value:
        return QUESTION
    holders = [value.get("items"), _mapped(value), *value.get("anyOf", ())]
    return next(filter(None, (inner_block(holder) for holder in holders if isinstance(holder, dict))), None)
