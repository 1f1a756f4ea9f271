"""The base class of all training settings: validation, stored names, and errors with place and remedy.

A setting has the name of the field (CleanRL's for PPO). Runs, task keys and checkpoints of earlier versions know some
settings by another name, its `serialization_alias`: that name is still written to disk, so that the hash of a run does
not change, and both names are accepted.
"""

import difflib
import tomllib
from collections.abc import Mapping, Sequence
from typing import Any, Self

from pydantic import BaseModel, ConfigDict, ValidationError

# pydantic's type of an error -> what to write instead; {} are limits of the error's context.
_REMEDIES = {
    "int_type": "Write a whole number.",
    "float_type": "Write a number.",
    "bool_type": "Write true or false.",
    "string_type": "Write a text.",
    "tuple_type": "Write a list, e.g. [128, 64].",
    "dict_type": "Write a table.",
    "literal_error": "Write {expected}.",
    "greater_than": "Write a number greater than {gt}.",
    "greater_than_equal": "Write a number of at least {ge}.",
    "less_than_equal": "Write a number of at most {le}.",
    "multiple_of": "Write a multiple of {multiple_of}.",
}


class ConfigError(ValueError):
    """A setting that does not exist or has a wrong value; names the place and what to write instead."""


class TrainingSettings(BaseModel):
    """Settings that a TOML file, `--set` or a stored run may change, each with a description."""

    model_config = ConfigDict(frozen=True, extra="forbid", strict=True)

    def changed(self, settings: Mapping[str, Any], source: str) -> Self:
        """Return a copy with `settings`, by their names or their stored names. Raises ConfigError naming `source`."""
        return type(self).checked({**self.model_dump(), **self._by_field_name(settings, source)}, source)

    @classmethod
    def checked(cls, settings: Mapping[str, Any], source: str) -> Self:
        """Return the settings of a mapping, by their names or their stored names. Raises ConfigError naming
        `source`."""
        try:
            return cls.model_validate(cls._by_field_name(settings, source))
        except ValidationError as error:
            raise ConfigError(f"{source}: {_explained(error)}") from error

    def stored(self) -> dict[str, Any]:
        """Return all settings by their stored names, as JSON values."""
        return self.model_dump(mode="json", by_alias=True)

    def differences(self) -> dict[str, Any]:
        """Return the settings that are not the defaults, by their stored names. They name a run, so a new setting
        does not change the name of an old run."""
        return self.model_dump(mode="json", by_alias=True, exclude_defaults=True)

    @classmethod
    def _by_field_name(cls, settings: Mapping[str, Any], source: str) -> dict[str, Any]:
        stored_names = {field.serialization_alias: name for name, field in cls.model_fields.items()}
        found: dict[str, Any] = {}
        for key, value in settings.items():
            name = stored_names.get(key, key)
            if name not in cls.model_fields:
                near = difflib.get_close_matches(key, cls.model_fields, 1)
                hint = f"Did you mean {near[0]!r}? " if near else ""
                raise ConfigError(f"{source}: unknown key {key!r}. {hint}Known: {', '.join(cls.model_fields)}.")
            if name in found:
                raise ConfigError(
                    f"{source}: {key} is the former name of {name}, which is there too. Write only {name}."
                )
            found[name] = value
        return found


def parsed_changes(words: Sequence[str]) -> dict[str, Any]:
    """Return the settings of `key=value` words of a command line; values are read as in TOML. Raises ConfigError."""
    changes = {}
    for word in words:
        key, equals, text = word.partition("=")
        if not equals:
            raise ConfigError(f"--set {word}: write it as key=value, e.g. --set learning_rate=0.001")
        changes[key.strip()] = _parsed(text.strip())
    return changes


def _parsed(text: str) -> Any:
    try:
        return tomllib.loads(f"x = {text}")["x"]
    except tomllib.TOMLDecodeError:
        return text  # a word without quotes, such as cnn


def _explained(error: ValidationError) -> str:
    """Return the first fault: which setting, its value, and what to write."""
    first = error.errors(include_url=False)[0]
    context = first.get("ctx", {})
    if first["type"] == "value_error":
        return str(context["error"])
    key = ".".join(str(part) for part in first["loc"])
    if first["type"] == "missing":
        return f"{key} is missing. Add a line: {key} = ..."
    remedy = _REMEDIES.get(first["type"], "{message}.").format(**context, message=first["msg"])
    return f"{key} is {first['input']!r}. {remedy}"
