"""Checks on an export before it is imported. Its content is not trusted."""

import hashlib
import json
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any, Final

import msgspec

from overcooked.layout import parse_layout
from server.play.episode_spec import EpisodeSpec

SUMS: Final = "SHA256SUMS"
_CROISSANT: Final = "croissant.json"
_MAX_BYTES: Final = 20_000_000  # of the files that describe an export
_NAME: Final = re.compile(r"[A-Za-z0-9][A-Za-z0-9_-]{0,127}")
_READ: Final = re.compile(r"(data|parquet|studies)/.*|codebook\.json")


class ImportRefused(ValueError):
    """The folder is not an export that can be trusted; the text names the place and the remedy."""


def plain_name(name: object, what: str) -> str:
    """Return `name` if it is safe in a file name: letters, digits, - and _ only. Raises ImportRefused."""
    if not isinstance(name, str) or not _NAME.fullmatch(name):
        raise ImportRefused(
            f"{what} {name!r} cannot be used as a file name. Names have letters, digits, - and _ only: correct it in "
            "the data, or export the study again."
        )
    return name


def check_files(folder: Path) -> None:
    """Refuse an export with a link, or with a file that differs from its SHA-256. Raises ImportRefused, OSError.

    The hashes come from SHA256SUMS; from croissant.json in exports that were written before there was SHA256SUMS.
    """
    listed, complete = _listed(folder)
    for path in _entries(folder):
        name = path.relative_to(folder).as_posix()
        if not _READ.fullmatch(name):
            continue
        if complete and name not in listed:
            raise ImportRefused(f"{path} is not listed in {SUMS}: it was added later. Export the study again.")
        if name in listed and _sha256(path) != listed[name]:
            raise ImportRefused(f"{path} was changed after the export: its SHA-256 differs. Export the study again.")


def study_source(folder: Path, name: str, sha256: str) -> str:
    """Return the text of a study file of the export. Raises ImportRefused unless it has this hash, OSError."""
    path = folder / name
    if not path.is_file():
        raise ImportRefused(f"{path} is missing. Export the study again.")
    content = path.read_bytes()
    if hashlib.sha256(content).hexdigest() != sha256:
        raise ImportRefused(f"{path} differs from the SHA-256 in the table of studies. Export the study again.")
    return content.decode("utf-8")


def episode_spec(text: str, episode: str, layout_sha256: str) -> dict[str, Any]:
    """Return the description of an episode as JSON values. Raises ImportRefused unless it can be played again."""
    try:
        spec = json.loads(text)
        grid = msgspec.convert(spec, EpisodeSpec).grid
        parse_layout(grid, name=f"the grid of episode {episode}")
    except (ValueError, TypeError, RecursionError, msgspec.MsgspecError) as error:
        raise ImportRefused(f"episode {episode}: its spec cannot be used ({error}). Export the study again.") from None
    if hashlib.sha256(grid.encode()).hexdigest() != layout_sha256:
        raise ImportRefused(f"episode {episode}: its grid differs from layout_sha256. Export the study again.")
    return dict(spec)


def write_sums(folder: Path) -> None:
    """Write the SHA-256 of every file of an export into SHA256SUMS, as `sha256sum --check` reads it."""
    lines = [f"{_sha256(path)}  {path.relative_to(folder).as_posix()}\n" for path in _entries(folder)]
    (folder / SUMS).write_text("".join(lines), encoding="utf-8")


def _entries(folder: Path) -> Iterator[Path]:
    """Yield every file below the folder. Raises ImportRefused for a link or anything else that is neither file nor
    folder."""
    for path in sorted(folder.iterdir()):
        if path.is_symlink() or not (path.is_file() or path.is_dir()):
            raise ImportRefused(f"{path} is a link or a device. Replace it with the file itself.")
        if path.is_dir():
            yield from _entries(path)
        else:
            yield path


def _listed(folder: Path) -> tuple[dict[str, str], bool]:
    """Return the recorded hashes by file name, and whether they name all files."""
    sums = folder / SUMS
    if sums.is_file():
        pairs = (line.split("  ", 1) for line in _small(sums).splitlines())
        return {pair[1]: pair[0] for pair in pairs if len(pair) == 2}, True
    path = folder / _CROISSANT
    if not path.is_file():
        return {}, False
    try:
        return {file["contentUrl"]: file["sha256"] for file in json.loads(_small(path))["distribution"]}, False
    except (ValueError, KeyError, TypeError, RecursionError):
        raise ImportRefused(f"{path} is damaged. Export the study again.") from None


def _small(path: Path) -> str:
    if path.is_symlink():
        raise ImportRefused(f"{path} is a link or a device. Replace it with the file itself.")
    if path.stat().st_size > _MAX_BYTES:
        raise ImportRefused(f"{path} has more than {_MAX_BYTES:,} bytes. Export the study again.")
    return path.read_text(encoding="utf-8")


def _sha256(path: Path) -> str:
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()
