"""Describe the machine of a measurement: the processor, its features that matter for speed, and the GPU if there is
one.
"""

import os
import platform
import re
from pathlib import Path

_AVX2 = "avx avx2 bmi bmi2 cx16 f16c fma fxsr lzcnt movbe pclmul popcnt sse sse2 sse3 sse4.1 sse4.2 ssse3"
AVX2_ONLY = {  # environment of a process that computes as on a processor without AVX-512: OpenBLAS, numba, numpy
    "OPENBLAS_CORETYPE": "Haswell",
    "NUMBA_CPU_NAME": "haswell",
    "NUMBA_CPU_FEATURES": ",".join(f"+{name}" for name in ("64bit", *_AVX2.split())),
    "NPY_DISABLE_CPU_FEATURES": "AVX512F AVX512CD AVX512_SKX AVX512_CLX AVX512_CNL AVX512_ICL AVX512_SPR X86_V4",
}
_DECIDING = ("avx2", "avx512f", "avx512_bf16", "amx_bf16", "neon", "asimd", "bf16")  # of the processor's flags


def described() -> str:
    """Return one line for a table of figures, e.g. "AMD EPYC, 2 cores, avx2"."""
    return ", ".join([_name(), f"{_cores()} cores", *(_features() or ["no features known"]), *_gpu()])


def _cpuinfo() -> str:
    path = Path("/proc/cpuinfo")
    return path.read_text(encoding="utf-8", errors="replace") if path.is_file() else ""


def _name() -> str:
    found = re.search(r"model name\s*:\s*(.+)", _cpuinfo())
    return found[1].strip() if found else platform.processor() or platform.machine()


def _cores() -> int:
    return os.cpu_count() or 1


def _features() -> list[str]:
    found = re.search(r"^(?:flags|Features)\s*:\s*(.+)", _cpuinfo(), re.MULTILINE)
    flags = set(found[1].split()) if found else set()
    return [name for name in _DECIDING if name in flags]


def _gpu() -> list[str]:
    try:
        import torch
    except ImportError:
        return []
    return [torch.cuda.get_device_name(0)] if torch.cuda.is_available() else []


if __name__ == "__main__":
    print(described())
