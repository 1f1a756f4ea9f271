"""A kitchenmind command in this process: what it says and its exit status, without the seconds that a new one takes."""

import io
import subprocess
from concurrent.futures import ThreadPoolExecutor
from contextlib import redirect_stderr, redirect_stdout

import kitchenmind


def run(*words: str) -> "subprocess.CompletedProcess[str]":
    """Run `kitchenmind *words` in another thread: a browser's event loop may be running in this one."""
    out, err = io.StringIO(), io.StringIO()
    with ThreadPoolExecutor(1) as other, redirect_stdout(out), redirect_stderr(err):
        status = other.submit(kitchenmind.main, words).result()
    return subprocess.CompletedProcess(["kitchenmind", *words], status, out.getvalue(), err.getvalue())
