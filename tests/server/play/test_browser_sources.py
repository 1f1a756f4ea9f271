"""The files that the pages' scripts share with the server are generated from the Python types, and both sides use one
table.
"""

import ast
import re
from pathlib import Path

import pytest
from msgspec import inspect

from server.play import browser_sources
from server.play.close_codes import CloseCode

ROOT = Path(__file__).parents[3]


@pytest.mark.parametrize("path", browser_sources.files(), ids=lambda path: path.name)
def test_written_files_are_those_of_the_types(path: Path) -> None:
    again = "Write it: python -m server.play.browser_sources"
    assert path.read_text(encoding="utf-8") == browser_sources.files()[path], again


def test_a_field_that_may_be_left_out_is_optional_only_in_what_the_browser_sends() -> None:
    text = browser_sources.types()
    assert "last_timestep?: number;" in text, "hello: it has a default"
    assert "endless: boolean;" in text, "welcome: it has a default too, and the server sends it all the same"
    assert "held: number | null;" in text


def test_a_type_without_counterpart_is_refused() -> None:
    with pytest.raises(TypeError, match="no TypeScript type"):
        browser_sources.type_of(inspect.DateTimeType())


def test_no_close_code_is_written_as_a_number() -> None:
    faults = []
    for file in (ROOT / "server").rglob("*.py"):
        for node in ast.walk(ast.parse(file.read_text(encoding="utf-8"))):
            if isinstance(node, ast.Call) and ast.unparse(node.func).split(".")[-1] in {"close", "send_close", "Close"}:
                numbers = [given for given in node.args if isinstance(given, ast.Constant)]
                faults += [f"{file.name}:{node.lineno}" for given in numbers if given.value in set(CloseCode)]
    for file in (ROOT / "static" / "js").rglob("*.js"):
        found = re.findall(r"(?:close\w*\(|[cC]ode === |\[)(\d{4})\b", file.read_text(encoding="utf-8"))
        faults += [f"{file.name}: {number}" for number in found if int(number) in set(CloseCode)]
    assert faults == []
