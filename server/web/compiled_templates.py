"""Keep compiled templates between processes, as Python keeps compiled modules."""

import importlib.util
import marshal
import os
import sys
from contextlib import suppress
from pathlib import Path
from typing import Final

import jinja2
from jinja2.bccache import Bucket

FOLDER: Final = Path(__file__).parent / "__pycache__"  # where the compiled code of this module is, too
_OPTIONS: Final = 1  # to be raised when the options of the environment change, which the compiled code depends on
_HEAD: Final = importlib.util.MAGIC_NUMBER + f"{jinja2.__version__} {_OPTIONS} ".encode()


class CompiledTemplates(jinja2.BytecodeCache):
    """One file a template. Jinja's own cache of files would do, but it reads a pickle (decision 6)."""

    def load_bytecode(self, bucket: Bucket) -> None:
        """Load what is kept of this very source; an unreadable file counts as none."""
        head = _HEAD + bucket.checksum.encode()
        with suppress(OSError, EOFError, ValueError, TypeError):
            kept = _path(bucket).read_bytes()
            if kept.startswith(head):
                bucket.code = marshal.loads(kept[len(head) :])  # noqa: S302 - as trusted as the code next to it

    def dump_bytecode(self, bucket: Bucket) -> None:
        """Keep a template for the next process. If the disk is full, it is compiled there again."""
        with suppress(OSError):
            new = _path(bucket).with_suffix(f".{os.getpid()}.tmp")  # renamed when it is whole: others may read it
            try:
                new.write_bytes(_HEAD + bucket.checksum.encode() + marshal.dumps(bucket.code))
                new.replace(_path(bucket))
            finally:
                new.unlink(missing_ok=True)


def compiled_templates() -> CompiledTemplates | None:
    """Return the cache, if this process may write compiled code."""
    may_write = not sys.dont_write_bytecode and os.access(FOLDER, os.W_OK)
    return CompiledTemplates() if may_write else None


def _path(bucket: Bucket) -> Path:
    return FOLDER / f"template.{bucket.key}.pyc"
