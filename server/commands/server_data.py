"""The options with which a command names the data of a server, as `kitchenmind serve` has them: `--data DIR` and
`--database URL`. Imports are inside functions, so that --help is quick.
"""

import argparse
from dataclasses import dataclass
from pathlib import Path


@dataclass(frozen=True)
class ServerData:
    """Where a server keeps its data. What is None is as in the settings. The folder has the trained models, and the
    database too unless `database` is given."""

    data: Path | None = None
    database: str | None = None

    @classmethod
    def of(cls, arguments: argparse.Namespace) -> "ServerData":
        """Return what the options name."""
        return cls(arguments.data, arguments.database or None)

    @property
    def is_named(self) -> bool:
        """Whether an option was given."""
        return self.data is not None or self.database is not None

    @property
    def url(self) -> str:
        """The database: that of `kitchenmind serve` with the same options. Raises ValueError for a wrong setting."""
        from server.settings import settings_with

        return self.database or settings_with(data=self.data).database

    @property
    def own_models(self) -> Path:
        """The folder of trained models."""
        from server.settings import own_models_here

        return own_models_here(self.data)


def add_data_options(
    parser: argparse.ArgumentParser,
    database: str = "sqlite:///path or postgresql://user@host/name",
    data: str = "the folder of `kitchenmind serve --data DIR`, with its database",
    default: str | None = None,
) -> None:
    """Add both options. `default=argparse.SUPPRESS`: a command's own command, which keeps what was given before it."""
    parser.add_argument("--database", metavar="URL", default=default, help=database)
    parser.add_argument("--data", type=Path, metavar="DIR", default=default, help=data)
