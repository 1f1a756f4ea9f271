"""The page of everything that a study file may contain, from its JSON schema."""

import json
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any, Final

import yaml

from docs.generate.markdown import cell, code, plain_type
from server.study.schema import study_schema

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
TEXT: Final = "Text"  # the type of what participants read, by language
QUESTION: Final = "SurveyQuestion"
IN_QUESTIONS: Final = "questions."
HEAD: Final = """# Study keys

Everything that a study file may contain. `kitchenmind study new NAME` makes a file to start from, and
`kitchenmind study check FILE` names every mistake with its line. An unknown key is an error. The examples come from the
repository's study files.

A *text* is what participants read: one text for all languages, or a mapping by language such as `{en: Age, zh: 年龄}`.

`python -m docs.generate` writes this page from `server/study`.

## Top level

"""
TABLE: Final = "| key | type | default | example | meaning |\n|---|---|---|---|---|\n"

Block = dict[str, Any]


def study_keys() -> str:
    """Return the page."""
    return "".join(_Page(study_schema()).lines())


class _Page:
    """The schema of a study file, with where each block is used and an example for each key."""

    def __init__(self, schema: Block) -> None:
        self.schema = schema
        self.blocks: dict[str, Block] = schema["$defs"]
        self.questions = [name for name, block in self.blocks.items() if _is_question(block)]
        self.places = self._places()
        self.examples: dict[tuple[str, str], Any] = {}
        for name in EXAMPLES:
            self._collect(yaml.load((ROOT / name).read_text(encoding="utf-8"), _BooleanReader), schema, "")  # noqa: S506 a safe loader

    def lines(self) -> Iterator[str]:
        yield HEAD
        yield from self._table(self.schema, "")
        in_questions = [name for name, used in self.places.items() if used[0].startswith(IN_QUESTIONS)]
        for name in self.places:
            if name not in in_questions:
                yield from self._block(name)
        yield from self._questions()
        for name in in_questions:
            yield from self._block(name)

    def _block(self, name: str) -> Iterator[str]:
        first, *others = self.places[name]
        yield f"\n## {_title(first)}\n\n{_summary(self.blocks[name])}"
        if others:
            yield f" Also used for {', '.join(_title(place) for place in others)}."
        yield "\n\n"
        yield from self._table(self.blocks[name], name)

    def _questions(self) -> Iterator[str]:
        """Yield the keys that all types of questions share once, then those of each type."""
        asking = [name for name in self.questions if "key" in self.blocks[name]["properties"]]
        first = self.blocks[asking[0]]
        shared = set.intersection(*(set(self.blocks[name]["properties"]) for name in asking)) - {"type"}
        for name in asking:
            self.examples |= {
                (QUESTION, key): self.examples[name, key] for key in shared if (name, key) in self.examples
            }
        yield "\n## Questions\n\nEvery question has a `type` and, unless it is `published`, these keys:\n\n"
        yield from self._table(_only(first, shared), QUESTION)
        for name in self.questions:
            block = self.blocks[name]
            yield f"\n### type: {block['properties']['type']['const']}\n\n{_summary(block)}\n\n"
            left_out = {"type", *(shared if name in asking else ())}
            yield from self._table(_only(block, block["properties"].keys() - left_out), name)

    def _table(self, block: Block, name: str) -> Iterator[str]:
        """Yield a row for each key of a block."""
        yield TABLE
        for key, value in block["properties"].items():
            inner = _inner(value)
            is_block = inner not in (None, TEXT)
            default = "required" if key in block.get("required", ()) else _default(value, is_block)
            example = "" if is_block else code(_flow(self.examples.get((name, key), value.get("examples", [None])[0])))
            meaning = value.get("description") or _summary(self.blocks[str(inner)])
            yield f"| `{key}` | {self._type(value)} | {default} | {example} | {cell(meaning)} |\n"

    def _type(self, value: Block) -> str:
        """Return a type in words; a block is a link to its table."""
        if "$ref" in value:
            name = str(value["$ref"]).rpartition("/")[2]
            return "text" if name == TEXT else f"[block](#{_anchor(self.places[name][0])})"
        if "oneOf" in value:
            return "[question](#questions)"
        if "anyOf" in value:
            kinds = [self._type(kind) for kind in value["anyOf"] if kind != {"type": "null"}]
            return " or ".join(dict.fromkeys(kinds))
        if "items" in value:
            return f"list of {self._type(value['items'])}"
        mapped = _mapped(value)
        return f"mapping of a name to a {self._type(mapped)}" if mapped else plain_type(value)

    def _places(self) -> dict[str, list[str]]:
        """Return, for each block, the keys that hold it, from the top of the file down."""
        found: dict[str, list[str]] = {}
        waiting = [("", self.schema)]
        while waiting:
            prefix, block = waiting.pop(0)
            for key, value in block.get("properties", {}).items():
                name = _inner(value)
                if name in (None, TEXT, QUESTION):
                    continue
                place = f"{prefix}{key}{'.NAME' * len(_mappings(value))}"
                if name not in found:
                    waiting.append((f"{place}.", self.blocks[str(name)]))
                found.setdefault(str(name), []).append(place)
        for question in self.questions:
            for key, value in self.blocks[question]["properties"].items():
                name = _inner(value)
                if name not in (None, TEXT):
                    found.setdefault(str(name), [f"{IN_QUESTIONS}{key}"])
        return found

    def _collect(self, value: Any, block: Block, name: str) -> None:
        """Keep the first value of each key, by block and key."""
        for key, inner in value.items():
            self.examples.setdefault((name, key), inner)
            target = _inner(block["properties"][key])
            if target in (None, TEXT):
                continue
            parts = inner if isinstance(inner, list) else [inner]
            for _ in _mappings(block["properties"][key]):
                parts = [entry for part in parts if isinstance(part, dict) for entry in part.values()]
            for part in parts:
                kind = self._question_of(part) if target == QUESTION else str(target)
                self._collect(part, self.blocks[kind], kind)

    def _question_of(self, question: Block) -> str:
        kinds = {self.blocks[name]["properties"]["type"]["const"]: name for name in self.questions}
        return str(kinds[question["type"]])


class _BooleanReader(yaml.SafeLoader):
    """Reads only true and false as booleans, like the loader of study files: No is a word."""

    yaml_implicit_resolvers = {  # noqa: RUF012 a copy of the base class's
        first: [pair for pair in pairs if pair[0] != "tag:yaml.org,2002:bool" or first in "tf"]
        for first, pairs in yaml.SafeLoader.yaml_implicit_resolvers.items()
    }


def _title(place: str) -> str:
    return f"`{place}`"


def _anchor(place: str) -> str:
    """Return the anchor of a heading, the same on the website and on GitHub."""
    return "".join(each for each in place.lower() if each.isalnum() or each == "_")


def _summary(block: Block) -> str:
    return cell(str(block.get("description", "")).split("\n\n")[0])


def _is_question(block: Block) -> bool:
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


def _mappings(value: Block) -> list[Block]:
    """Return the types of the values of a mapping and of the mappings inside it."""
    held = [value, *value.get("anyOf", ())]
    mapped = next(filter(None, map(_mapped, held)), None)
    return [mapped, *_mappings(mapped)] if mapped else []


def _inner(value: Block) -> str | None:
    """Return the name of the block inside a key, `Question` for a question of any type, None for a plain value."""
    if "$ref" in value:
        return str(value["$ref"]).rpartition("/")[2]
    if "oneOf" in value:
        return QUESTION
    holders = [value.get("items"), _mapped(value), *value.get("anyOf", ())]
    return next(filter(None, (_inner(holder) for holder in holders if isinstance(holder, dict))), None)
