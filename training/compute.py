"""Choose how a run computes by a short measurement: device, number format and form of the first layers.

Processors differ by more than a factor of ten in which of these is fast (bfloat16 without its instructions, a dense
convolution on a wide grid), so nothing is assumed. The choice changes rounding only, so it is not part of a run's name.
"""

import contextlib
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, TypeVar

import torch

DEVICES = ("auto", "cpu", "cuda", "mps")
PRECISIONS = ("auto", "float32", "bfloat16")
_REPEATS = 3
_HOPELESS = 2.0  # a candidate that was this many times slower at its first try is not tried again
_PRODUCT = (512, 512, 512)
_WORTH_TRYING = 1.2  # bfloat16 products must be this many times faster before a network is tried with them

Choice = TypeVar("Choice")


class ComputeError(ValueError):
    """A device or number format that this machine does not have; the message says what to write instead."""


@dataclass(frozen=True)
class Compute:
    """How one network is computed in training.

    Forms: "direct" is the network as it is written, "dense" has each layer as one matrix product, "sparse" multiplies
    only the entries of the observation that are not zero, "sparse_dense" does so and has the later layers dense, and
    "lanes" does so and computes later convolutions with the samples in the lanes of vector registers.
    """

    device: str = "cpu"
    precision: str = "float32"  # of the matrix products
    form: str = "sparse"

    @property
    def dtype(self) -> torch.dtype:
        return torch.bfloat16 if self.precision == "bfloat16" else torch.float32

    def __str__(self) -> str:
        return f"{self.device}, {self.precision}, {self.form}"


@dataclass(frozen=True)
class Request:
    """What the command line asks for; "auto" leaves the choice to a measurement."""

    device: str = "auto"
    precision: str = "auto"

    def chosen_device(self) -> str:
        """Return the device to use. Raises ComputeError if it does not exist here."""
        here = available_devices()
        if self.device == "auto":
            return here[0]
        if self.device not in here:
            raise ComputeError(
                f"--device {self.device}: this machine has {', '.join(here)}. Write one of them or auto."
            )
        return self.device

    def precisions(self, device: str) -> tuple[str, ...]:
        """Return the number formats that are worth measuring on the device."""
        if self.precision != "auto":
            return (self.precision,)
        return ("float32", "bfloat16") if bfloat16_is_fast(device) else ("float32",)


_requested = [Request()]


def request(device: str = "auto", precision: str = "auto") -> Request:
    """Set what this process computes with, as `torch.set_num_threads` does for threads. Raises ComputeError."""
    for option, value, known in (("--device", device, DEVICES), ("--precision", precision, PRECISIONS)):
        if value not in known:
            raise ComputeError(f"{option} {value}: unknown. Write one of {', '.join(known)}.")
    wanted = Request(device, precision)
    wanted.chosen_device()
    _requested[0] = wanted
    return wanted


def requested() -> Request:
    """Return the request of this process."""
    return _requested[0]


def collecting_device() -> str:
    """Return the device of agents while games are collected: a partner has 20 games at once, too few for a GPU unless
    the user requests one."""
    return "cpu" if requested().device == "auto" else requested().chosen_device()


def available_devices() -> list[str]:
    """Return the devices of this machine, the fastest first."""
    devices = ["cuda"] if torch.cuda.is_available() else []
    if torch.backends.mps.is_available():
        devices.append("mps")
    return [*devices, "cpu"]


def bfloat16_is_fast(device: str) -> bool:
    """Measure whether bfloat16 products are faster than float32 ones here."""
    rows, inner, columns = _PRODUCT
    seconds = {}
    for dtype in (torch.float32, torch.bfloat16):
        a, b = (
            torch.ones(rows, inner, dtype=dtype, device=device),
            torch.ones(inner, columns, dtype=dtype, device=device),
        )
        seconds[dtype] = min(_timed(lambda a=a, b=b: torch.mm(a, b), device) for _ in range(_REPEATS))  # type: ignore[misc]
    return seconds[torch.bfloat16] * _WORTH_TRYING < seconds[torch.float32]


def quickest(
    candidates: Sequence[Choice], prepare: Callable[[Choice], Callable[[], object]], device: str = "cpu"
) -> tuple[Choice, dict[str, float]]:
    """Return the candidate whose prepared function takes the least time, and the milliseconds of each. The first call
    of a function is not measured: it compiles or allocates.
    """
    best: dict[Choice, float] = {}
    for candidate in candidates:
        function = prepare(candidate)
        function()
        best[candidate] = _timed(function, device)
        if best[candidate] > _HOPELESS * min(best.values()):
            continue
        for _ in range(_REPEATS - 1):
            best[candidate] = min(best[candidate], _timed(function, device))
    winner = min(best, key=lambda candidate: best[candidate])
    return winner, {str(candidate): round(1000 * seconds, 3) for candidate, seconds in best.items()}


def autocast(device: str, precision: str) -> contextlib.AbstractContextManager[Any]:
    """Compute matrix products in `precision` on `device`."""
    if precision == "float32":
        return contextlib.nullcontext()
    return torch.autocast(device, torch.bfloat16)


def _timed(function: Callable[[], object], device: str) -> float:
    """Return the seconds of a call: this process's CPU time, so that other programs do not count, or wall time on a
    GPU."""
    clock = time.process_time if device == "cpu" else time.perf_counter
    _wait(device)
    began = clock()
    function()
    _wait(device)
    return clock() - began


def _wait(device: str) -> None:
    """Wait for the GPU before reading the clock: it keeps working after a call has returned."""
    if device == "cuda":
        torch.cuda.synchronize()
    elif device == "mps":
        torch.mps.synchronize()
