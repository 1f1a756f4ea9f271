"""The SHA-256 of the models that this process has loaded, and which of them are others than in earlier rounds of a
version of a study, such as after an upgrade in the middle of data collection.
"""

from collections.abc import Callable

from sqlalchemy import Connection

from server.required_models import Name, RequiredModels
from server.store.played_models import PlayedModel, played_models

Fingerprint = Callable[[str, str], str | None]  # (layout, model) -> SHA-256; None: it has no file


class ModelHashes:
    """Hashes as they were when the models were loaded: what replaces a file later does not play before a restart."""

    def __init__(self) -> None:
        self._found: dict[Name, str | None] = {}

    def loaded(self, required: RequiredModels) -> None:
        """Note the models of these studies; one that is known already stays loaded as it is."""
        for name in (*required.agents, *required.predictors):
            if name not in self._found:
                self._found[name] = required.fingerprint(*name)

    def of(self, layout: str, model: str) -> str | None:
        """Return the hash of a model; None for one without files."""
        return self._found.get((layout, model))


def changed_models(connection: Connection, study: str, sha256: str, now: Fingerprint) -> list[str]:
    """Return a sentence about each model with which people played a version of a study, and whose weights were others
    then. `sha256` identifies the version."""
    found = [(one, now(one.layout, one.model)) for one in played_models(connection, study, sha256)]
    return [_words(one, current) for one, current in found if current is not None and current != one.sha256]


def _words(played: PlayedModel, current: str) -> str:
    many = "1 round" if played.rounds == 1 else f"{played.rounds} rounds"
    return (
        f"`{played.model}` on `{played.layout}` is not the same as in {many} that people have played in this version "
        f"of the study (SHA-256 {played.sha256[:12]}…, now {current[:12]}…). They played on kitchenmind "
        f"{played.code_version}: to continue with the same model, install that version again."
    )
