"""The JSON schema of a study file, for editors.

The docstring below a key becomes its description here, when the schema is requested. pydantic would read it from the
sources at every import, which would delay the start of the server.
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
    """Return the schema of a study file, with a description of each key."""
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
