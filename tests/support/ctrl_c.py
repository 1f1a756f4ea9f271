"""Ctrl+C for the processes of tests."""

import signal
from collections.abc import Iterator
from contextlib import contextmanager


@contextmanager
def ctrl_c_enabled() -> Iterator[None]:
    """Let processes that are started in this block react to Ctrl+C; tests in the background of a shell ignore it."""
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, before)
