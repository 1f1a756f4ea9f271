"""Passwords of researchers: Argon2id, and no difference in time between a wrong name and a wrong password."""

from functools import cache

from argon2 import PasswordHasher
from argon2.exceptions import InvalidHashError, VerificationError

_hasher = PasswordHasher()  # RFC 9106, low memory: 64 MiB, 3 passes


def hashed(password: str) -> str:
    """What is stored."""
    return _hasher.hash(password)


def is_right(password: str, stored: str | None) -> bool:
    """Whether it is the password; without an account it takes as long to say no."""
    try:
        return _hasher.verify(stored or _nobody(), password) and stored is not None
    except (VerificationError, InvalidHashError):
        return False


@cache
def _nobody() -> str:
    return _hasher.hash("nobody has this password")
