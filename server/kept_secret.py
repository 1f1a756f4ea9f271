"""The secret that signs forms in local mode, which the server makes itself and keeps in a file."""

import fcntl
import os
import secrets
from contextlib import suppress
from pathlib import Path


def kept_secret(path: Path) -> bytes:
    """Return the secret in a file, which only its owner can read; it is made if there is none.

    An empty file, which a full disk or a killed process leaves behind, counts as none: everybody could sign with it.
    Raises ValueError if it cannot be written, OSError if it cannot be read.
    """
    with suppress(FileNotFoundError):
        if found := path.read_bytes():
            return found
    with os.fdopen(os.open(path, os.O_RDWR | os.O_CREAT, 0o600), "r+b", buffering=0) as file:
        fcntl.flock(file, fcntl.LOCK_EX)  # another process of this server may be making it
        if found := file.read():
            return found
        made = secrets.token_urlsafe(32).encode()
        try:
            file.write(made)
            os.fsync(file.fileno())
        except OSError as error:
            file.truncate(0)
            raise ValueError(
                f"cannot keep the secret in {path} ({error.strerror}). Make room there, or set KITCHENMIND_SECRET"
            ) from None
        return made
