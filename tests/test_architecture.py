"""The architecture: imports as in the table of docs/explanation/architecture.md, no cycles, readable sizes."""

import ast
import re
import subprocess
import sys
from collections.abc import Iterator
from functools import cache
from pathlib import Path

import pytest

ROOT = Path(__file__).parent.parent
PACKAGES = ("kitchenmind", "overcooked", "models", "training", "analysis", "server")
MAX_FILE_LINES, MAX_FUNCTION_LINES, MAX_ARGUMENTS = 300, 40, 6

# Functions above the limits, and why.
LONG_FILES: dict[str, str] = {}
LONG_FUNCTIONS: dict[str, str] = {}
MANY_ARGUMENTS = {
    "training.fused_ppo_loss.forward": "the arguments of ppo_loss",
    "training.ppo_loss.ppo_loss": "the terms of the formula, by name",
}

Tree = ast.Module
Function = ast.FunctionDef | ast.AsyncFunctionDef


@cache
def modules() -> dict[str, Tree]:
    """Every module of the packages by its dotted name."""
    files = [file for package in PACKAGES for file in (ROOT / package).rglob("*.py")]
    return {_dotted(file): ast.parse(file.read_text(encoding="utf-8")) for file in files}


def _dotted(file: Path) -> str:
    return ".".join(file.relative_to(ROOT).with_suffix("").parts).removesuffix(".__init__")


@cache
def tracked_texts() -> dict[str, str]:
    listed = subprocess.run(["git", "ls-files", "-z"], cwd=ROOT, capture_output=True, text=True, check=True)
    texts = {}
    for name in filter(None, listed.stdout.split("\0")):
        try:
            texts[name] = (ROOT / name).read_text(encoding="utf-8")
        except (UnicodeDecodeError, FileNotFoundError):
            continue
    return texts


def imports(tree: ast.AST, everywhere: bool = True) -> Iterator[str]:
    """The dotted names that a module imports; `everywhere` also inside functions and for type checking."""
    for node in ast.iter_child_nodes(tree):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, "relative imports hide where a thing comes from"
            yield from (_imported_module(f"{node.module}.{alias.name}", str(node.module)) for alias in node.names)
        elif everywhere or not _is_late(node):
            yield from imports(node, everywhere)


def _imported_module(name: str, parent: str) -> str:
    return name if name in modules() else parent


def _is_late(node: ast.AST) -> bool:
    for_types = isinstance(node, ast.If) and "TYPE_CHECKING" in ast.unparse(node.test)
    return for_types or isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef)


def allowed() -> dict[str, set[str]]:
    """The table of docs/explanation/architecture.md: package -> what it may import."""
    page = (ROOT / "docs" / "explanation" / "architecture.md").read_text(encoding="utf-8")
    rows = re.findall(r"^\| `([\w.]+)` \|[^|]*\|([^|]*)\|$", page, re.MULTILINE)
    return {package: set(re.findall(r"`([\w.]+)`", cell)) for package, cell in rows}


def test_the_table_names_every_package() -> None:
    assert {package.split(".")[0] for package in allowed()} == set(PACKAGES)
    assert len(allowed()) >= 10


@pytest.mark.parametrize("package", allowed())
def test_package_imports_only_what_the_table_allows(package: str) -> None:
    rows = allowed()
    faults = []
    for module, tree in modules().items():
        row = max((name for name in rows if _within(module, name)), key=len)
        if row != package:
            continue
        for name in imports(tree):
            standard = name.split(".")[0] in sys.stdlib_module_names
            outside = row == "server" and not _within(name, "training")
            if not (standard or outside or any(_within(name, allow) for allow in rows[row] | {row})):
                faults.append(f"{module} imports {name}")
    assert faults == []


def _within(name: str, package: str) -> bool:
    return name == package or name.startswith(package + ".")


def test_modules_import_each_other_without_cycles() -> None:
    graph = {
        module: {name for name in imports(tree, everywhere=False) if name in modules()}
        for module, tree in modules().items()
    }
    done: set[str] = set()
    for module in graph:
        _visit(module, graph, [], done)


def _visit(module: str, graph: dict[str, set[str]], path: list[str], done: set[str]) -> None:
    assert module not in path, " -> ".join([*path[path.index(module) :], module])
    if module not in done:
        for imported in graph[module] - {module}:
            _visit(imported, graph, [*path, module], done)
        done.add(module)


def test_class_names_are_unique_in_the_project() -> None:
    others = [path for folder in ("tests", "benchmarks", "docs") for path in (ROOT / folder).rglob("*.py")]
    places: dict[str, list[str]] = {}
    for module, tree in {**modules(), **{str(path): ast.parse(path.read_text()) for path in others}}.items():
        for node in ast.walk(tree):
            if isinstance(node, ast.ClassDef) and not node.name.startswith("_"):
                places.setdefault(node.name, []).append(module)
    assert len(places) > 200
    assert {name: found for name, found in places.items() if len(found) > 1} == {}


def functions(tree: Tree) -> Iterator[Function]:
    return (node for node in ast.walk(tree) if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef))


def _lines_of_code(function: Function) -> int:
    """Count lines without signature and docstring."""
    body = function.body[1:] if ast.get_docstring(function) and len(function.body) > 1 else function.body
    return (function.end_lineno or 0) - body[0].lineno + 1


def _argument_count(function: Function) -> int:
    arguments = function.args
    names = [argument.arg for argument in arguments.posonlyargs + arguments.args + arguments.kwonlyargs]
    return len([name for name in names if name not in ("self", "cls")])


def _is_kernel(function: Function) -> bool:
    """Compiled code takes its arrays one by one: numba looks up a tuple's or an object's type at every call."""
    return any(
        "kernel" in ast.unparse(decorator) or "njit" in ast.unparse(decorator) for decorator in function.decorator_list
    )


def test_files_are_short_or_listed_with_a_reason() -> None:
    long = {module for module in modules() if (ROOT / _path(module)).read_text().count("\n") > MAX_FILE_LINES}
    assert long == set(LONG_FILES)


def _path(module: str) -> str:
    file = module.replace(".", "/")
    return f"{file}.py" if (ROOT / f"{file}.py").exists() else f"{file}/__init__.py"


def test_functions_are_short_or_listed_with_a_reason() -> None:
    long = {
        f"{module}.{function.name}"
        for module, tree in modules().items()
        for function in functions(tree)
        if _lines_of_code(function) > MAX_FUNCTION_LINES
    }
    assert long == set(LONG_FUNCTIONS)


def test_functions_take_few_arguments_or_are_listed_with_a_reason() -> None:
    many = {
        f"{module}.{function.name}"
        for module, tree in modules().items()
        for function in functions(tree)
        if _argument_count(function) > MAX_ARGUMENTS and not _is_kernel(function)
    }
    assert many == set(MANY_ARGUMENTS)


def test_every_module_says_what_it_is_for() -> None:
    assert [module for module, tree in modules().items() if tree.body and not ast.get_docstring(tree)] == []


def test_no_module_has_a_catch_all_name() -> None:
    odd = {"utils", "helpers", "common", "misc", "tools"}
    assert [module for module in modules() if odd & set(module.split("."))] == []


def test_every_folder_of_tests_is_a_package() -> None:
    folders = {file.parent for file in (ROOT / "tests").rglob("*.py")}
    assert [folder for folder in folders if not (folder / "__init__.py").exists()] == [], "names could collide"


def test_every_file_is_text_weights_or_a_picture() -> None:
    listed = subprocess.run(["git", "ls-files", "-z"], cwd=ROOT, capture_output=True, text=True, check=True)
    binary = set(filter(None, listed.stdout.split("\0"))) - tracked_texts().keys()
    kinds = {Path(name).suffix for name in binary if (ROOT / name).is_file()}
    assert kinds <= {".safetensors", ".webp", ".png", ".gz"}


def test_nothing_is_pickled() -> None:
    forbidden = re.compile(
        r"^\s*(import|from) (pickle|cloudpickle|dill|joblib)\b|\btorch\.load\(|allow_pickle=True|\.recv\(\)$"
    )
    faults = [
        f"{name}:{number}"
        for name, text in tracked_texts().items()
        if name.endswith(".py") and not name.startswith("tests/")
        for number, line in enumerate(text.splitlines(), start=1)
        if forbidden.search(line)
    ]
    assert faults == []


def test_no_file_names_a_folder_of_one_machine() -> None:
    folders = re.compile(r"(?<![\w.])/(?:work|root|home|Users|mnt|data|opt)/\w")
    faults = [
        f"{name}:{number}"
        for name, text in tracked_texts().items()
        if Path(name).suffix in {".py", ".md", ".yaml", ".yml", ".toml", ".js", ".html", ".json", ".ini", ""}
        for number, line in enumerate(text.splitlines(), start=1)
        if folders.search(line)
    ]
    assert faults == []
