"""The JSON schema of a study file, for editors.

The sentence below a key becomes its description here, when the schema is asked for. pydantic would read it from the
sources whenever the module is imported, and games wait for a server that starts.
"""

import ast
import inspect
from collections.abc import Iterator
from itertools import pairwise
from typing import Any

from pydantic import BaseModel

from server.study.definition import Study
from server.study.strict_model import StrictModel


def study_schema() -> dict[str, Any]:
    """What a study file may hold, each key with what it is for."""
    schema = Study.model_json_schema() | {"title": "A study of kitchenmind"}
    for part in _parts(StrictModel):
        block = schema if part is Study else schema["$defs"].get(part.__name__, {})
        for key, sentence in descriptions(part).items():
            if key in block.get("properties", {}):
                block["properties"][key]["description"] = sentence
    return schema


def _parts(base: type[StrictModel]) -> Iterator[type[StrictModel]]:
    for part in base.__subclasses__():
        yield part
        yield from _parts(part)


def descriptions(model: type[BaseModel]) -> dict[str, str]:
    """Return the string below each key of a model and of the models that it is derived from."""
    found = {}
    for ancestor in reversed(model.__mro__):
        if issubclass(ancestor, BaseModel) and ancestor.__module__.startswith("server."):
            body = ast.parse(inspect.getsource(ancestor)).body[0]
            assert isinstance(body, ast.ClassDef)  # noqa: S101 its source begins with it
            for key, below in pairwise(body.body):
                match key, below:
                    case ast.AnnAssign(target=ast.Name(id=name)), ast.Expr(value=ast.Constant(value=str(text))):
                        found[name] = inspect.cleandoc(text)
    return found
