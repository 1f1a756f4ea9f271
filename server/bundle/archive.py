"""A zip file of texts: equal texts give equal bytes, and reading does not trust the file. No file is extracted by its
name in the archive, so a name cannot point outside a folder.
"""

import hashlib
import io
import json
import re
import zipfile
from collections.abc import Mapping
from pathlib import Path
from typing import Any, Final

MANIFEST: Final = "manifest.json"
MAX_BYTES: Final = 20_000_000  # of the file, and of all texts together
MAX_FILES: Final = 200
_NAME: Final = re.compile(r"[a-z0-9_]+(/[a-z0-9_]+)?(\.[a-z]+)?")
_MAKE_ONE: Final = "Make one with `kitchenmind bundle STUDY`."
_LONG_AGO: Final = (1980, 1, 1, 0, 0, 0)  # the same bytes whenever it is made


class BundleRefused(ValueError):
    """The file is not a bundle, is damaged, or does not fit this machine; the message says why and what to do."""


def packed(texts: Mapping[str, str], manifest: Mapping[str, Any]) -> bytes:
    """Return the archive; the manifest gets the hash of every text."""
    hashes = {name: _sha256(text.encode()) for name, text in sorted(texts.items())}
    manifest_text = json.dumps({**manifest, "files": hashes}, indent=1, ensure_ascii=False, sort_keys=True) + "\n"
    stream = io.BytesIO()
    with zipfile.ZipFile(stream, "w") as archive:
        for name, text in sorted({**texts, MANIFEST: manifest_text}.items()):
            entry = zipfile.ZipInfo(name, _LONG_AGO)
            entry.compress_type, entry.external_attr = zipfile.ZIP_DEFLATED, 0o644 << 16
            archive.writestr(entry, text.encode())
    return stream.getvalue()


def unpacked(path: Path) -> tuple[dict[str, str], dict[str, Any]]:
    """Return the texts by name, checked against their hashes, and the manifest. Raises BundleRefused, OSError."""
    if path.stat().st_size > MAX_BYTES:
        raise BundleRefused(f"{path} is too large for a bundle. {_MAKE_ONE}")
    try:
        with zipfile.ZipFile(path) as archive:
            content = _content(archive)
        texts = {name: data.decode() for name, data in content.items()}
        manifest = json.loads(texts.pop(MANIFEST))
        hashes = dict(manifest["files"])
    except (zipfile.BadZipFile, NotImplementedError, RuntimeError, EOFError, UnicodeDecodeError) as error:
        raise BundleRefused(f"{path} cannot be read: {error}. Fetch it again.") from None
    except (KeyError, TypeError, ValueError, RecursionError) as error:
        if isinstance(error, BundleRefused):
            raise
        raise BundleRefused(f"{path} is not a bundle. {_MAKE_ONE}") from None
    for name in sorted(hashes.keys() | texts.keys()):
        if name not in texts or hashes.get(name) != _sha256(texts[name].encode()):
            raise BundleRefused(f"{path}: {name} is not as it was bundled. Fetch the bundle again.")
    return texts, manifest


def _content(archive: zipfile.ZipFile) -> dict[str, bytes]:
    entries = archive.infolist()
    if len(entries) > MAX_FILES or len({entry.filename for entry in entries}) != len(entries):
        raise BundleRefused(f"this archive has too many files, or two of one name. It is not a bundle. {_MAKE_ONE}")
    content: dict[str, bytes] = {}
    left = MAX_BYTES
    for entry in entries:
        if not _NAME.fullmatch(entry.filename):
            raise BundleRefused(f"this archive has a file {entry.filename!r}. It is not a bundle. {_MAKE_ONE}")
        with archive.open(entry) as file:
            content[entry.filename] = file.read(left + 1)  # the size in a header is not trusted
        left -= len(content[entry.filename])
        if left < 0:
            raise BundleRefused(f"the contents of this archive are too large for a bundle. {_MAKE_ONE}")
    return content


def _sha256(content: bytes) -> str:
    return hashlib.sha256(content).hexdigest()
