"""The decorator of all compiled kernels, and the maintenance of their cache."""

import atexit
import gc
import importlib
import sys
from collections.abc import Iterable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path


@contextmanager
def collector_off() -> Iterator[None]:
    """Switch Python's garbage collector off, for imports: they make many objects and no garbage."""
    was_on = gc.isenabled()
    gc.disable()
    try:
        yield
    finally:
        if was_on:
            gc.enable()


with collector_off():
    from numba import njit as njit
    from numba.core.registry import cpu_target

# Before it ends, Python examines every object once more, which takes as long as importing numba. It leaves out frozen
# objects: their memory is released with the process.
atexit.register(gc.freeze)

# Compiled on first use, then kept next to the sources (`__pycache__/*.nbi`), so that the next process starts at once.
kernel = njit(cache=True, error_model="numpy")
threaded_kernel = njit(cache=True, error_model="numpy", nogil=True)  # other threads run while it does
inlined_kernel = njit(cache=True, error_model="numpy", inline="always")

_FOLDER = Path(__file__).parent
_KERNEL_SOURCES = ("compiled.py", "constants.py", "observe.py", "planes.py", "rules.py", "score.py", "vector_env.py")


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
def without_linear_algebra() -> Iterator[None]:
    """Hide scipy.linalg from numba. Loading it takes a third of the time to a process's first step."""
    is_loaded = "scipy.linalg" in sys.modules
    if not is_loaded:
        sys.modules["scipy.linalg"] = None  # type: ignore[assignment] # as if it were not installed
    try:
        yield
    finally:
        if not is_loaded:
            del sys.modules["scipy.linalg"]


with collector_off():
    # numba asks for it once, here, to make `np.convolve` and `np.correlate` of compiled code faster. All else that
    # needs BLAS asks again when it is compiled.
    with without_linear_algebra():
        importlib.import_module("numba.np.arraymath")
    cpu_target.target_context.refresh()  # what numba would otherwise load at the first call of a kernel

with suppress(OSError):  # installed in a read-only folder, where the sources do not change either
    forget_stale_code()
