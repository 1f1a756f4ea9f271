"""Texts in several languages."""

from collections.abc import Mapping
from typing import Any

from pydantic import ConfigDict, RootModel, model_validator

ANY_LANGUAGE = "any"


class Text(RootModel[dict[str, str]]):
    """What a participant reads, by language. In a study file: a mapping `{en: ..., zh: ...}`, or plain words that
    are the same in every language (a name, a number)."""

    model_config = ConfigDict(frozen=True, json_schema_extra=lambda schema: _either(schema))

    @model_validator(mode="before")
    @classmethod
    def _plain_words(cls, data: Any) -> Any:
        if isinstance(data, str | int | float) and not isinstance(data, bool):
            return {ANY_LANGUAGE: str(data)}
        if isinstance(data, Mapping) and not data:
            raise ValueError("there is no text. Write {en: ...} with a text per language")
        return data

    def of(self, language: str) -> str:
        """Return the text in `language`; if it is missing, in the first language that has one."""
        words = self.root
        return words.get(language) or words.get(ANY_LANGUAGE) or next(iter(words.values()))

    def missing(self, languages: tuple[str, ...]) -> tuple[str, ...]:
        """Return the languages without words."""
        return (
            ()
            if ANY_LANGUAGE in self.root
            else tuple(name for name in languages if not self.root.get(name, "").strip())
        )


def _either(schema: dict[str, Any]) -> None:
    """For editors: a mapping by language, or plain words."""
    by_language = {"type": "object", "additionalProperties": {"type": "string"}, "minProperties": 1}
    for key in ("type", "additionalProperties"):
        schema.pop(key, None)
    schema["anyOf"] = [{"type": "string"}, by_language]
