"""A factorial design: every combination of the factors' levels as a condition. Pure."""

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from itertools import product
from typing import Annotated, Any, Final

from pydantic import AfterValidator, BeforeValidator, Field, GetJsonSchemaHandler, ValidationInfo
from pydantic_core import CoreSchema, PydanticKnownError

from server.study.condition import BlockOrder, Condition, ConditionSettings
from server.study.latin_square import balanced_square
from server.study.questionnaire import Key
from server.study.strict_model import StrictModel

SETTING_OF: Final = {"prediction": "predictor", "opacity": "confidence_opacity", "steps": "steps_shown"}
DEFAULT_PREDICTOR: Final = "tom"
MAX_FACTORS: Final = 4
MAX_CELLS: Final = 32
MAX_NAME_LENGTH: Final = 40


class Cells(StrictModel):
    """How the levels of `factors` are combined. Each combination is a condition with the same weight."""

    without: tuple[Key, ...] = Field(default=(), examples=[["none_on"]])
    """Conditions to leave out, by the names of their levels: `none_on`. Empty: all combinations, a full factorial."""
    within: tuple[Key, ...] = Field(default=(), examples=[["prediction"]])
    """Factors of which every participant meets all levels, each in a block of rounds. The conditions are then the
    orders of the blocks. Empty: every participant has one level of each factor."""
    quota: Annotated[int, Field(ge=1)] | None = Field(default=None, examples=[20])
    """The largest number of participants in each condition, of all versions of the study together. Empty: no limit."""


def _no_bare_list(levels: Any) -> Any:
    """Refuse levels without settings, unless the factor is named like a setting."""
    if isinstance(levels, list):
        known = ", ".join([*SETTING_OF, *sorted(set(ConditionSettings.model_fields) - {"misleading"})])
        raise ValueError(
            f"these levels change no setting: {_words(levels)}. Write them as a block such as "
            f"`LEVEL: {{show: on_key}}`, or name the factor like a setting: {known}"
        )
    return levels


def _words(levels: Sequence[Any]) -> str:
    return ", ".join(str(level)[:20] for level in levels[:5])


class _OrNames:
    """For editors: a mapping of levels, or their names alone."""

    def __get_pydantic_json_schema__(self, core: CoreSchema, handler: GetJsonSchemaHandler) -> dict[str, Any]:
        names = {"type": "array", "items": {"type": "string"}, "minItems": 2}
        return {"anyOf": [handler(core), names]}


Levels = Annotated[
    dict[Key, ConditionSettings], Field(min_length=2, max_length=8), BeforeValidator(_no_bare_list), _OrNames()
]


def _written_out(factors: Any) -> Any:
    """Turn levels that are only named into blocks: `opacity: [off, on]` sets `confidence_opacity`."""
    if not isinstance(factors, Mapping):
        return factors
    return {name: _block(str(name), levels) for name, levels in factors.items()}


def _block(name: str, levels: Any) -> Any:
    setting = SETTING_OF.get(name, name)
    named = isinstance(levels, list) and all(isinstance(level, str) for level in levels)
    if not named or setting not in ConditionSettings.model_fields or len(set(levels)) < len(levels):
        return levels
    return {level: {setting: level} for level in levels}


Factors = Annotated[dict[Key, Levels], Field(max_length=MAX_FACTORS), BeforeValidator(_written_out)]


def crossed(factors: Mapping[str, Iterable[str]]) -> Iterator[tuple[str, dict[str, str]]]:
    """Yield each combination of levels: the condition's name, and its level of each factor."""
    for levels in product(*factors.values()):
        yield "_".join(levels), dict(zip(factors, levels, strict=True))


def arms(
    factors: Mapping[str, Iterable[str]], within: Sequence[str]
) -> Iterator[tuple[str, tuple[dict[str, str], ...]]]:
    """Yield each condition: its name, and the level of each factor in each of its blocks of rounds. Without factors
    within people there is one block. The orders of the blocks are the rows of a balanced Latin square."""
    blocks = [levels for _, levels in crossed({name: factors[name] for name in factors if name in within})]
    orders = balanced_square(len(blocks)) if len(blocks) > 1 else [[0]]
    for between, levels in crossed({name: factors[name] for name in factors if name not in within}):
        for number, order in enumerate(orders, start=1):
            name = "_".join(part for part in (between, f"order_{number}" if len(orders) > 1 else "") if part)
            seen = [levels | blocks[place] for place in order]
            yield name, tuple({factor: block[factor] for factor in factors} for block in seen)


def levels_of(factors: Any) -> dict[str, tuple[str, ...]]:
    """Return the names of the levels by factor, from the values of a study's text; {} where there are none."""
    if not isinstance(factors, Mapping):
        return {}
    return {str(name): tuple(map(str, levels)) for name, levels in factors.items() if isinstance(levels, dict | list)}


def set_by(level: ConditionSettings) -> list[str]:
    """Return the settings that a level changes."""
    return [
        key for key in type(level).model_fields if key in level.model_fields_set and getattr(level, key) is not None
    ]


def conditions_of(factors: Mapping[str, Mapping[str, ConditionSettings]], cells: Cells) -> tuple[Condition, ...]:
    """Return the conditions of a factorial design. Raises ValueError with a remedy."""
    count = math.prod(len(levels) for levels in factors.values())
    if count > MAX_CELLS:
        raise ValueError(f"the levels have {count} combinations. Use factors with at most {MAX_CELLS}")
    found: list[Condition] = []
    for name, blocks in arms(factors, cells.within):
        if name in cells.without:
            continue
        seen = tuple(_condition(factors, levels, cells) for levels in blocks)
        if len(seen) == 1:
            found.append(seen[0])
            continue
        settings = next((one for one in seen if "none" not in (one.predictor, one.display)), seen[0])
        found.append(BlockOrder(**dict(settings) | {"name": _fits(name), "blocks": seen}))
    if not found:
        raise ValueError("`without` leaves no condition. Leave fewer out")
    return tuple(found)


def _condition(
    factors: Mapping[str, Mapping[str, ConditionSettings]], levels: dict[str, str], cells: Cells
) -> Condition:
    """Return one combination of levels."""
    settings = {"predictor": DEFAULT_PREDICTOR, "quota": cells.quota, "name": _fits("_".join(levels.values()))}
    for factor, level in levels.items():
        chosen = factors[factor][level]
        settings |= {key: getattr(chosen, key) for key in set_by(chosen)}
    return Condition(**settings)


def _fits(name: str) -> str:
    if len(name) > MAX_NAME_LENGTH:
        raise ValueError(
            f"the condition {name} has more than {MAX_NAME_LENGTH} characters. Use shorter names of levels"
        )
    return name


def _made(conditions: tuple[Condition, ...], info: ValidationInfo) -> tuple[Condition, ...]:
    """Return the conditions as written, or the combinations of the factors' levels."""
    if not {"factors", "cells"} <= info.data.keys():
        return conditions  # their problems are reported already
    if not info.data["factors"] and not conditions:
        raise PydanticKnownError("missing")
    if conditions and info.data["factors"]:
        raise ValueError("`factors` already make the conditions. Remove `conditions`, or remove `factors`")
    return conditions or conditions_of(info.data["factors"], info.data["cells"])


Conditions = Annotated[
    tuple[Condition, ...], AfterValidator(_made), Field(validate_default=True, json_schema_extra={"minItems": 1})
]
