"""A network on disk: one folder with config.json, weights.safetensors, card.md and sha256. A changed byte is refused.
The config describes the network; `policy` and the predictors interpret it. No pickle, no torch.
"""

import hashlib
import json
import os
import shutil
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from numpy.typing import NDArray
from safetensors.numpy import load, save

from models.networks.stored_tensors import Bits, bits_of, restored, stored

CONFIG, WEIGHTS, CARD, SUMS = "config.json", "weights.safetensors", "card.md", "sha256"
FILES = (CONFIG, WEIGHTS, CARD)


class CheckpointError(ValueError):
    """A damaged or unreadable checkpoint folder; the message names the file and the remedy."""


@dataclass(frozen=True)
class Checkpoint:
    """The contents of a folder. `sha256` identifies these weights with this config in data and on screen. `bits`: how
    the file stores its numbers; `tensors` are float32."""

    folder: Path
    config: dict[str, Any]
    tensors: dict[str, NDArray[Any]]
    card: str
    sha256: str
    bits: Bits


def save_checkpoint(
    folder: Path, config: dict[str, Any], tensors: Mapping[str, Any], card: str, bits: Bits = 32
) -> str:
    """Write the folder (all or nothing: an old one is replaced at the end) and return its sha256. Raises
    CheckpointError if the folder holds something else, OSError.

    `tensors`: arrays, or torch's without a gradient, on any device. With fewer `bits` the file is smaller
    (`stored_tensors`); check that the network still performs as its card says.
    """
    refuse_other_content(folder)
    folder = folder.absolute()  # "." has no name
    new = folder.with_name(f".{folder.name}.new-{os.getpid()}")
    shutil.rmtree(new, ignore_errors=True)
    new.mkdir(parents=True)
    here = {name: tensor.cpu() if hasattr(tensor, "cpu") else tensor for name, tensor in tensors.items()}
    try:
        (new / WEIGHTS).write_bytes(save(stored(here, bits)))
        (new / CONFIG).write_text(json.dumps(config, indent=2) + "\n", encoding="utf-8")
        (new / CARD).write_text(card.rstrip() + "\n", encoding="utf-8")
        lines = "".join(f"{_digest((new / name).read_bytes())}  {name}\n" for name in FILES)
        (new / SUMS).write_text(lines, encoding="utf-8")
    except OSError:  # a full disk
        shutil.rmtree(new, ignore_errors=True)
        raise
    shutil.rmtree(folder, ignore_errors=True)
    new.rename(folder)
    return _digest(lines.encode())


def refuse_other_content(folder: Path) -> None:
    """Raise CheckpointError if a checkpoint written to `folder` would delete something that is not part of one, such as
    the checkpoints below it. Hidden files, which file managers write, do not count."""
    names = sorted(path.name for path in folder.iterdir()) if folder.is_dir() else []
    others = [name for name in names if name not in (*FILES, SUMS) and not name.startswith(".")]
    if others:
        raise CheckpointError(
            f"{folder}: holds {others[0]}, which a checkpoint written there would delete. Give a folder of its own, "
            f"such as {folder / 'mine'}."
        )


def load_checkpoint(folder: Path | str) -> Checkpoint:
    """Read a folder after checking every byte; tensors come as float32. Raises CheckpointError."""
    folder = Path(folder)
    if not folder.is_dir():
        raise CheckpointError(f"{folder}: there is no such checkpoint folder. Check the name, or train it.")
    content = {name: _checked(folder, name, line) for name, line in _expected(folder).items()}
    try:
        config = json.loads(content[CONFIG])
        arrays = load(content[WEIGHTS])
        tensors = restored(arrays)
    except Exception as error:
        raise CheckpointError(
            f"{folder}: unreadable although its checksums match ({error}). Train or fetch it again."
        ) from error
    digest = _digest((folder / SUMS).read_bytes())
    return Checkpoint(folder, config, tensors, content[CARD].decode(), digest, bits_of(arrays))


def _expected(folder: Path) -> dict[str, str]:
    """Return file name -> the digest in `sha256`."""
    if not (folder / SUMS).is_file():
        raise CheckpointError(
            f"{folder / SUMS}: missing, so nothing here can be checked. Fetch the whole folder again."
        )
    pairs = [line.split() for line in (folder / SUMS).read_text(encoding="utf-8", errors="replace").splitlines()]
    expected = {pair[1]: pair[0] for pair in pairs if len(pair) == 2}
    if set(expected) != set(FILES):
        raise CheckpointError(f"{folder / SUMS}: must list exactly {', '.join(FILES)}. Fetch the whole folder again.")
    return expected


def _checked(folder: Path, name: str, digest: str) -> bytes:
    path = folder / name
    if not path.is_file():
        raise CheckpointError(f"{path}: missing. Fetch the whole folder again.")
    content = path.read_bytes()
    if _digest(content) != digest:
        raise CheckpointError(f"{path}: its bytes are not those that were saved (sha256 differs). Fetch it again.")
    return content


def _digest(content: bytes) -> str:
    return hashlib.sha256(content).hexdigest()
