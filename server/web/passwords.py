"""Passwords of researchers: Argon2id, and no difference in time between a wrong name and a wrong password."""

import re
from functools import cache

from argon2 import PasswordHasher
from argon2.exceptions import InvalidHashError, VerificationError

MIN_LENGTH, MAX_LENGTH = 10, 200
_ROWS = ("01234567890123456789", "qwertyuiopasdfghjklzxcvbnm", "abcdefghijklmnopqrstuvwxyz", "1q2w3e4r5t6y7u8i9o0p")
# The long words from lists of the most common passwords, to which people often append digits.
_COMMON = frozenset(
    re.findall(
        r"\w+",
        """
        password passwort passw0rd p4ssword letmein welcome admin administrator superman batman sunshine princess
        iloveyou football baseball basketball monkey dragon master shadow michael jennifer jordan charlie trustno1
        whatever computer internet starwars qwerty qwertz azerty abc changeme changemenow secret default guest test
        testtest login hello helloworld freedom liverpool chelsea arsenal manchester america corvette mercedes ferrari
        porsche butterfly chocolate strawberry elephant pokemon minecraft overcooked research researcher student
        university professor experiment participant prolific mypassword passwordpassword password1234 qwerty123
        1qaz2wsx 1qaz2wsx3edc zaq12wsx q1w2e3r4t5 iloveyouforever lovelove fuckyou fuckyouall blink182 unknown
        samsung1 google facebook summer winter spring autumn
        """,
    )
)
_hasher = PasswordHasher()  # RFC 9106, low memory: 64 MiB, 3 passes


def hashed(password: str) -> str:
    """Return what is stored."""
    return _hasher.hash(password)


def weakness(password: str, name: str) -> str | None:
    """Return why this password is easy to guess; None if it is not."""
    plain = re.sub(r"[^a-z0-9]", "", password.lower())
    letters = plain.rstrip("0123456789")
    if not MIN_LENGTH <= len(password) <= MAX_LENGTH:
        return f"a password has {MIN_LENGTH} to {MAX_LENGTH} characters"
    if len(set(password)) < 5:
        return "it has fewer than 5 different characters"
    if name.lower() in password.lower() or "kitchenmind" in plain:
        return "it has the account's or the platform's name in it"
    if any(plain in row or plain in row[::-1] for row in _ROWS):
        return "it is a row of keys or letters"
    if letters in _COMMON or plain in _COMMON or any(plain == 2 * word for word in _COMMON):
        return "it is one of the passwords that are tried first"
    return None


def is_right(password: str, stored: str | None) -> bool:
    """Return whether the password is correct; without an account the check takes the same time."""
    try:
        return _hasher.verify(stored or _nobody(), password) and stored is not None
    except (VerificationError, InvalidHashError):
        return False


@cache
def _nobody() -> str:
    return _hasher.hash("nobody has this password")
