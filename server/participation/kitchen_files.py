"""Each kitchen of the dashboard as a `.layout` file in the folder of the data, for the commands that train."""

import logging
import os
from collections.abc import Mapping
from pathlib import Path

log = logging.getLogger(__name__)


def write_kitchens(folder: Path, grids: Mapping[str, str | None]) -> None:
    """Write the file of each kitchen; remove that of a kitchen without a grid. Failures are logged: the database has
    the kitchens, and the kitchen's page says if its file is not there."""
    for name, grid in grids.items():
        path = folder / f"{name}.layout"
        try:
            if grid is None:
                path.unlink(missing_ok=True)
            elif not path.is_file() or path.read_text("utf-8") != grid + "\n":
                folder.mkdir(parents=True, exist_ok=True)
                new = path.with_name(f".{name}.{os.getpid()}")
                new.write_text(grid + "\n", encoding="utf-8")
                new.replace(path)  # other server processes may write the same file
        except (OSError, ValueError) as error:
            log.warning("the kitchen %s could not be written as %s: %s", name, path, error)
