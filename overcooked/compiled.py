"""The decorator of all compiled kernels, and the maintenance of their cache."""

import importlib
import sys
from collections.abc import Iterable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from numba import njit

# Compiled on first use, then kept next to the sources (`__pycache__/*.nbi`), so that the next process starts at once.
kernel = njit(cache=True, error_model="numpy")
threaded_kernel = njit(cache=True, error_model="numpy", nogil=True)  # other threads run while it does
inlined_kernel = njit(cache=True, error_model="numpy", inline="always")

_FOLDER = Path(__file__).parent
_KERNEL_SOURCES = ("compiled.py", "constants.py", "observe.py", "rules.py", "score.py", "vector_env.py")


def forget_stale_code(folder: Path = _FOLDER) -> int:
    """Delete compiled code older than any kernel's source; return how many files.

    numba looks only at the file that a function is in. Otherwise `vector_env` would keep using the old code of a
    changed rule.
    """
    return forget_code_older_than([folder / source for source in _KERNEL_SOURCES], folder)


def forget_code_older_than(sources: Iterable[Path], folder: Path) -> int:
    """Delete the compiled code in `folder` that is older than any of the sources; return how many files.

    For packages whose kernels call those of other modules.
    """
    newest = max(source.stat().st_mtime_ns for source in sources)
    stale = [file for file in (folder / "__pycache__").glob("*.nb[ic]") if file.stat().st_mtime_ns < newest]
    for file in stale:
        file.unlink(missing_ok=True)
    return len(stale)


@contextmanager
def only_our_kernels() -> Iterator[None]:
    """Hide scipy.linalg and cffi from numba, which imports them for kernels that call BLAS or C. Ours do neither."""
    unneeded = {"scipy.linalg", "cffi"} - sys.modules.keys()
    sys.modules.update(dict.fromkeys(unneeded))  # type: ignore[arg-type] # None: as if it were not installed
    try:
        yield
    finally:
        for name in unneeded:
            del sys.modules[name]


# Loading scipy.linalg takes a third of the time to a process's first step. numba asks for it once, here, to make
# `np.convolve` and `np.correlate` of compiled code faster; all else that needs BLAS asks again when it is compiled.
with only_our_kernels():
    importlib.import_module("numba.np.arraymath")

with suppress(OSError):  # installed in a read-only folder, where the sources do not change either
    forget_stale_code()
