"""Resolve the name of a model: a file or folder relative to some folder, or a Python class and its source file."""

import ast
import os
import re
import sys
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from pathlib import Path

WEIGHTS = Path(__file__).parents[1] / "weights"
_VARIANT = re.compile(r"@(?:greedy|sampled|\d+(?:\.\d+)?)$")  # how an agent acts, how often a predictor is right
_URLS = ("http://", "https://")


@dataclass(frozen=True)
class ModelPaths:
    """Where the models of some studies are. `files`: a name as written in a study -> the same with an absolute path;
    `folders`: where Python modules are looked for; `checkpoints`: (kitchen, name without variant) -> the folder of a
    checkpoint of one's own."""

    files: Mapping[str, str] = field(default_factory=dict)
    folders: tuple[str, ...] = ()
    checkpoints: Mapping[tuple[str, str], str] = field(default_factory=dict)

    def located(self, layout: str, name: str) -> str:
        """Return the name with its absolute path; a name without a path stays as it is."""
        base = without_variant(name)
        folder = self.checkpoints.get((layout, base))
        return self.files.get(name, name) if folder is None else f"{folder}{name[len(base) :]}"


def without_variant(name: str) -> str:
    """Return the name without `@greedy`, `@sampled` or `@60`. Addresses and classes may have an @ of their own."""
    return _VARIANT.sub("", name)


def is_class(name: str) -> bool:
    """Return whether a name means `module:Class`."""
    return ":" in name and not name.startswith(_URLS)


def located(name: str, folder: Path) -> str:
    """Return `name` with a relative path made absolute from `folder`; catalogue names, classes and addresses as
    they are. A bare name is a folder only if nothing bundled has that name."""
    base = without_variant(name)
    if ":" in base:
        return name
    is_path = "/" in base or base.endswith(".onnx") or _is_checkpoint_in(base, folder)
    return f"{os.path.normpath(folder.absolute() / base)}{name[len(base) :]}" if is_path else name


def _is_checkpoint_in(name: str, folder: Path) -> bool:
    bundled = any((layout / name).is_dir() for layout in WEIGHTS.iterdir()) if WEIGHTS.is_dir() else False
    return not bundled and (folder / name / "config.json").is_file()


def source_file(name: str, folders: Iterable[str] = ()) -> Path | None:
    """Return the source file of `package.module:Class`, found as an import would find it but without running anything;
    None if there is none."""
    parts = without_variant(name).partition(":")[0].split(".")
    for folder in (*sys.path, *folders, "."):
        place = Path(folder or ".").joinpath(*parts)
        for file in (place / "__init__.py", place.with_name(f"{place.name}.py")):
            if file.is_file():
                return file
    return None


def has_class(file: Path, name: str) -> bool:
    """Return whether the module in `file` may define the class of `module:Class`; true if that cannot be decided
    without running it. Raises SyntaxError, or ValueError or RecursionError, for a file that is not Python."""
    wanted = without_variant(name).partition(":")[2]
    tree = ast.parse(file.read_bytes())
    for node in ast.walk(tree):
        if isinstance(node, ast.ClassDef | ast.FunctionDef) and node.name == wanted:
            return True
        if isinstance(node, ast.ImportFrom | ast.Import):
            names = {alias.asname or alias.name for alias in node.names}
            if wanted in names or "*" in names:
                return True
        if isinstance(node, ast.Name) and isinstance(node.ctx, ast.Store) and node.id in (wanted, "__getattr__"):
            return True
    return False


def make_importable(folders: Iterable[str]) -> None:
    """Add these folders and the current one to the end of Python's module search path."""
    for folder in (*folders, str(Path.cwd())):
        if folder not in sys.path:
            sys.path.append(folder)
