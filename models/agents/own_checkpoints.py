"""Find the checkpoints of agents and predictors that researchers trained, by name: FOLDER/KITCHEN/NAME.

A study names them like bundled ones. Names never lead out of the folder: no path is accepted, and no link. The version
of a study that was opened keeps its own copy of them in FOLDER/.kept/SHA256, so that training again under the same name
does not change it.
"""

import json
import os
import re
import shutil
from contextlib import suppress
from dataclasses import dataclass
from hashlib import sha256
from pathlib import Path
from typing import Any, Final

from models.networks.checkpoint import CONFIG, FILES, SUMS, CheckpointError, load_checkpoint

KEPT: Final = ".kept"
_NAME: Final = re.compile(r"[A-Za-z0-9][A-Za-z0-9_.-]{0,79}")
_FORMATS: Final = {"kitchenmind agent": "agent", "kitchenmind predictor": "predictor"}


def name_in_study(folder: Path, kitchen: str) -> str:
    """Return how a study names a checkpoint folder: by its name if it is in a folder `models/KITCHEN`."""
    place = folder.absolute().parent
    return folder.name if (place.name, place.parent.name) == (kitchen, "models") else str(folder)


@dataclass(frozen=True)
class OwnCheckpoint:
    """A checkpoint folder. `kind`: agent or predictor; `sha256` identifies its files, as in the data."""

    folder: Path
    kind: str
    grid: str
    sha256: str

    @property
    def size(self) -> int:
        """The number of bytes of its files."""
        return sum((self.folder / file).stat().st_size for file in (*FILES, SUMS))


@dataclass(frozen=True)
class OwnCheckpoints:
    """All checkpoints below one folder, which need not exist."""

    root: Path

    def of_kitchen(self, kitchen: str, grid: str | None = None) -> dict[str, OwnCheckpoint]:
        """Return the complete checkpoints of a kitchen by name; `grid`: only those that were trained for it."""
        place = self.root / kitchen
        names = sorted(path.name for path in place.iterdir()) if _NAME.fullmatch(kitchen) and place.is_dir() else []
        found = {name: self.find(kitchen, name) for name in names}
        return {name: one for name, one in found.items() if one is not None and grid in (None, one.grid)}

    def find(self, kitchen: str, name: str, wanted: str | None = None) -> OwnCheckpoint | None:
        """Return a checkpoint, None if there is none or it is not complete. `wanted`: only the one with this SHA-256,
        and the kept copy rather than the folder that training may change."""
        if not (_NAME.fullmatch(kitchen) and _NAME.fullmatch(name)):
            return None
        kept = self._kept(wanted) if wanted is not None else None
        if kept is not None:
            return kept
        here = self._read(self.root / kitchen / name)
        return here if here is not None and wanted in (None, here.sha256) else None

    def kept(self) -> list[OwnCheckpoint]:
        """Return the complete kept copies."""
        place = self.root / KEPT
        names = sorted(path.name for path in place.iterdir()) if place.is_dir() else []
        return [copy for copy in map(self._kept, names) if copy is not None]

    def drop(self, sha256: str) -> None:
        """Delete a kept copy. Raises OSError."""
        shutil.rmtree(self.root / KEPT / sha256)

    def _kept(self, wanted: str) -> OwnCheckpoint | None:
        kept = self._read(self.root / KEPT / wanted) if _NAME.fullmatch(wanted) else None
        return kept if kept is not None and kept.sha256 == wanted else None

    def keep(self, kitchen: str, name: str, wanted: str) -> None:
        """Copy a checkpoint to where training does not change it. Raises CheckpointError, OSError."""
        target = self.root / KEPT / wanted
        found = self.find(kitchen, name, wanted)
        if found is None:
            raise CheckpointError(
                f"{self.root / kitchen / name}: there is no checkpoint with the SHA-256 {wanted}. Put it "
                "back, or open the study again."
            )
        if found.folder == target:
            return
        new = target.with_name(f".new-{os.getpid()}-{wanted}")
        shutil.rmtree(new, ignore_errors=True)
        new.mkdir(parents=True)
        try:
            for file in (*FILES, SUMS):
                shutil.copyfile(found.folder / file, new / file)
            if load_checkpoint(new).sha256 != wanted:
                raise CheckpointError(f"{found.folder}: its files have just changed. Try again.")
            with suppress(OSError):
                new.rename(target)
                return
            if self._kept(wanted) is None:  # damaged; otherwise another process has just made the copy
                shutil.rmtree(target, ignore_errors=True)
                new.rename(target)
        finally:
            shutil.rmtree(new, ignore_errors=True)

    def fault(self, kitchen: str, name: str) -> str | None:
        """Return why a folder of this name cannot be used, as a clause; None if there is no such folder."""
        place = self.root / kitchen / name
        if not (_NAME.fullmatch(kitchen) and _NAME.fullmatch(name) and os.path.lexists(place)):
            return None
        if not all(self._is_inside(place / file) for file in (*FILES, SUMS)):
            return f"{place} is a link that leads out of {self.root}"
        missing = [file for file in (*FILES, SUMS) if not (place / file).is_file()]
        return f"{place} is not a checkpoint: it has no {missing[0]}" if missing else f"{place} is not a checkpoint"

    def _read(self, folder: Path) -> OwnCheckpoint | None:
        if not all((folder / file).is_file() and self._is_inside(folder / file) for file in (*FILES, SUMS)):
            return None
        try:
            config: Any = json.loads((folder / CONFIG).read_text("utf-8"))
            kind = _FORMATS.get(str(config["format"]).rpartition(" ")[0])
            sums = (folder / SUMS).read_bytes()
        except (OSError, ValueError, KeyError, TypeError, RecursionError):
            return None
        return OwnCheckpoint(folder, kind, str(config.get("grid")), sha256(sums).hexdigest()) if kind else None

    def _is_inside(self, file: Path) -> bool:
        """Return whether a path stays in the folder when all links are followed."""
        try:
            return file.resolve().is_relative_to(self.root.resolve())
        except (OSError, RuntimeError):  # a circle of links
            return False
