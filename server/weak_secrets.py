"""Detect weak secrets: digits in order, rows of keys, repetitions, words."""

import re
from typing import Final

_ROWS: Final = (
    "01234567890",
    "qwertyuiopasdfghjklzxcvbnm",
    "abcdefghijklmnopqrstuvwxyz",
    "1q2w3e4r5t6y7u8i9o0p",
    "qwertz",
    "azerty",
)
_WORDS: Final = re.compile(
    r"secret|change|me|default|kitchen|mind|password|passwd|token|admin|example|test|production|key|please|this|your"
)
_MIN_RUN: Final = 3


def effective_length(secret: str) -> int:
    """Return how many characters of it are not predictable from those before. A run of three or more characters that
    follows a row of keys or of the alphabet, stays on one character, or repeats what stood before counts as one
    character; so does a word that is common in secrets.
    """
    text = _WORDS.sub("\0", secret.lower())
    length, at = 0, 0
    while at < len(text):
        at += max(1, _run(text, at))
        length += 1
    return length


def _run(text: str, at: int) -> int:
    """Return the length of the longest predictable run that begins here; 0: none."""
    longest = 0
    for end in range(at + _MIN_RUN, len(text) + 1):
        piece = text[at:end]
        known = any(piece in row or piece[::-1] in row for row in _ROWS)
        if not known and piece not in text[:at] and len(set(piece)) > 1:
            break
        longest = end - at
    return longest


def is_weak(secret: str, at_least: int) -> bool:
    """Return whether somebody could guess it. `at_least`: characters that must not be predictable."""
    return effective_length(secret) < at_least or len(set(secret)) < 8
