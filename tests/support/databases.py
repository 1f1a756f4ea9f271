"""SQLite databases with the tables: copied from one that was migrated once, as migrating takes a tenth of a second."""

import atexit
import shutil
import tempfile
from functools import cache
from pathlib import Path

from server.store.migrate import migrate


@cache
def _template() -> Path:
    folder = Path(tempfile.mkdtemp(prefix="kitchenmind-template-"))
    atexit.register(shutil.rmtree, folder, ignore_errors=True)
    migrate(f"sqlite:///{folder}/study.db")
    return folder / "study.db"


def with_tables(file: Path) -> str:
    """Make `file` a database with the tables and without rows, unless it is there; return its address."""
    if not file.exists():
        shutil.copyfile(_template(), file)
    return f"sqlite:///{file}"
