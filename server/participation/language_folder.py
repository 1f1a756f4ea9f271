"""Languages that are put into the server's data folder while it runs: studies of the dashboard have no folder of their
own. Every server process reads the folder."""

import asyncio
import logging
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path
from typing import Final

from server.study.locale import add_language, refuse_language
from server.study.own_languages import LanguageError, language_files, read

log = logging.getLogger(__name__)
LOOK_EVERY_S: Final = 3.0


class LanguageFolder:
    """The languages of a folder: a file that is new or has changed is read, without a restart."""

    def __init__(self, folder: Path) -> None:
        """What is there now was read with the studies."""
        self._folder = folder
        self._stamps = dict(self._found())

    async def run(self) -> None:
        """Look every few seconds, until this is cancelled."""
        while True:
            await asyncio.sleep(LOOK_EVERY_S)
            try:
                await asyncio.to_thread(self.refresh)
            except Exception:
                log.exception("the languages in %s could not be read", self._folder)

    def refresh(self) -> None:
        """Use new and changed files. The log and the check of a study say why one cannot be used; the language keeps
        the words that it had, so that no page of a participant breaks."""
        found = dict(self._found())
        for path in [path for path, stamp in found.items() if self._stamps.get(path) != stamp]:
            try:
                add_language(path.stem, read(path))
            except LanguageError as error:
                refuse_language(path.stem, error.lines[0])
                log.warning("a language cannot be used: %s", error)
            except OSError:
                del found[path]  # it has gone, or cannot be read yet
            else:
                log.info("the words of %s were read from %s", path.stem, path)
        self._stamps = found

    def _found(self) -> Iterator[tuple[Path, tuple[int, int]]]:
        """Yield the files with modification time and size."""
        for path in language_files(self._folder):
            with suppress(OSError):
                about = path.stat()
                yield path, (about.st_mtime_ns, about.st_size)
