"""The base class of all blocks of a study file: frozen; an unknown key is refused, with the most similar known key."""

import difflib
from collections.abc import Mapping
from typing import Any

from pydantic import BaseModel, ConfigDict, model_validator
from pydantic_core import PydanticCustomError


class StrictModel(BaseModel):
    """One block of a study file."""

    model_config = ConfigDict(frozen=True, extra="forbid", defer_build=True)  # built as one, with the study

    @model_validator(mode="before")
    @classmethod
    def _known_keys_only(cls, data: Any) -> Any:
        if not isinstance(data, Mapping):
            return data
        known = list(cls.model_fields)
        for key in data:
            if key not in known:
                near = difflib.get_close_matches(str(key), known, 1, 0.5)
                remedy = f"Did you mean {near[0]!r}?" if near else f"Known here: {', '.join(known)}."
                raise PydanticCustomError(
                    "unknown_key", "{key!r} is not a key of this block. {remedy}", {"key": key, "remedy": remedy}
                )
        return data
