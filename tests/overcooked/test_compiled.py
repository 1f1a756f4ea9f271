"""Stale compiled code is deleted, and compiled code loads no unused packages."""

import os
import subprocess
import sys
from pathlib import Path

import overcooked.compiled as compiled

FIRST_STEP = """
import atexit, gc, sys
atexit.register(lambda: print("frozen" if gc.get_freeze_count() > 100_000 else "looked at once more"))
import numpy as np
from overcooked.layout import load_layout
from overcooked.state import Kitchens
kitchen = Kitchens.start(load_layout("coordination_ring"))
kitchen.step(np.zeros((1, 2), np.int8), np.zeros((1, 2), np.int32))
kitchen.encode()
print("scipy.linalg" in sys.modules, gc.isenabled())
"""
OWN_KERNEL_WITH_BLAS = """
import numba
print(numba.njit(lambda a: (a @ a)[0, 0])(np.full((2, 2), 3.0)))
"""


def folder_with(tmp_path: Path, source_time: int, code_time: int) -> Path:
    (tmp_path / "__pycache__").mkdir()
    for source in compiled._KERNEL_SOURCES:
        (tmp_path / source).touch()
        os.utime(tmp_path / source, (100, 100))
    os.utime(tmp_path / "rules.py", (source_time, source_time))
    for name in ("vector_env._step.nbi", "vector_env._step.1.nbc"):
        (tmp_path / "__pycache__" / name).touch()
        os.utime(tmp_path / "__pycache__" / name, (code_time, code_time))
    return tmp_path


def test_code_older_than_any_kernel_source_is_forgotten(tmp_path: Path) -> None:
    folder = folder_with(tmp_path, source_time=300, code_time=200)
    assert compiled.forget_stale_code(folder) == 2
    assert list((folder / "__pycache__").iterdir()) == []


def test_code_newer_than_its_sources_is_kept(tmp_path: Path) -> None:
    assert compiled.forget_stale_code(folder_with(tmp_path, source_time=200, code_time=300)) == 0


def test_the_watched_sources_are_those_of_kernels_and_of_what_they_use() -> None:
    folder = Path(compiled.__file__).parent
    with_kernels = {file.name for file in folder.glob("*.py") if "overcooked.compiled import" in file.read_text()}
    assert with_kernels | {"compiled.py", "constants.py", "planes.py", "score.py"} == set(compiled._KERNEL_SOURCES)


def test_a_first_step_loads_no_linear_algebra_and_other_kernels_can_still_use_it() -> None:
    words = [sys.executable, "-c", FIRST_STEP + OWN_KERNEL_WITH_BLAS]
    answer = subprocess.run(words, capture_output=True, text=True, check=True)
    assert answer.stdout.split("\n")[:2] == ["False True", "18.0"]
    assert answer.stdout.split("\n")[2] == "frozen"  # what numba made is left out of the last collection
