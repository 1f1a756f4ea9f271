"""Find tables of an export that are not as they were exported, by its SHA256SUMS."""

import hashlib
from pathlib import Path

from analysis.formatting import listed
from analysis.table_files import COLUMNS, table_file

SUMS = "SHA256SUMS"


def changed_tables(folder: Path) -> list[str]:
    """Return the names of the files that a report reads and whose hash differs; none where there are no hashes."""
    try:
        lines = (folder / SUMS).read_text(encoding="utf-8").splitlines()
    except (OSError, ValueError):
        return []
    sums = {name.strip(): digest for digest, _, name in (line.partition("  ") for line in lines)}
    found = []
    for name in COLUMNS:
        path = table_file(folder, name)
        known = sums.get(path.relative_to(folder).as_posix()) if path else None
        if path and known and hashlib.sha256(path.read_bytes()).hexdigest() != known:
            found.append(path.relative_to(folder).as_posix())
    return found


def changed_notice(folder: Path) -> str:
    """Say which tables were changed since the export; empty if none was."""
    if not (names := changed_tables(folder)):
        return ""
    what = "is not as it was" if len(names) == 1 else "are not as they were"
    return (
        f"{listed(names)} {what} exported (SHA256SUMS). If you did not change this on purpose, export the study again."
    )
