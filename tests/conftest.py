"""For all tests: one thread a process, as many run side by side, and child processes inherit it."""

import os
from pathlib import Path

import pytest

for library in (
    "OMP_NUM_THREADS",
    "MKL_NUM_THREADS",
    "OPENBLAS_NUM_THREADS",
    "NUMBA_NUM_THREADS",
    "POLARS_MAX_THREADS",
):
    os.environ.setdefault(library, "1")

# Files are handed out whole, in this order: what takes long first, so that no worker is left with it at the end.
LONG_FIRST = ("test_style.py", "journeys", "test_bots.py", "test_several_workers.py", "faults", "training", "security")


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    def rank(item: pytest.Item) -> int:
        place = item.path.relative_to(Path(__file__).parent).parts
        return next((number for number, name in enumerate(LONG_FIRST) if name in place), len(LONG_FIRST))

    items.sort(key=rank)
