"""Where a report comes from: its data, versions, seed, and the command that makes it again."""

import hashlib
import shlex
from datetime import UTC, datetime
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path

from analysis import (
    formatting,
)
from analysis.results import select
from analysis.study import Analysis, Options
from analysis.table_files import COLUMNS, table_file
from analysis.tables import Export


def provenance(analysis: Analysis, options: Options) -> dict[str, str]:
    """Return the lines of the report's box, label to text."""
    export = analysis.export
    people = analysis.episodes.unique("participant")["condition"]
    arms = [f"{int((people == name).sum())} {formatting.condition_title(name)}" for name in analysis.conditions]
    flow = {row.test: row.n for row in select(analysis.rows, section="exclusions", condition="all", unit="episodes")}
    return {
        "Data set": f"sha256 {fingerprint(export.folder)[:32]}…",
        export.subjects.participants.capitalize(): f"{people.len()} analysed"
        + (f": {', '.join(arms)}" if arms else ""),
        "Study": str(export.about.get("title") or export.study),
        "Study version": _version(export),
        "Episodes": f"{flow.get('played', 0)} played, {flow.get('analysed', 0)} analysed",
        "Software": _software(export),
        "Seed": str(options.seed),
        "Make it again": _command(export, options),
        "Made": f"{datetime.now(UTC):%d %B %Y, %H:%M} UTC",
    }


def _version(export: Export) -> str:
    if export.version is not None:
        return f"{export.version} alone"
    return ", ".join(str(version) for version in export.versions) or "not recorded"


def _command(export: Export, options: Options) -> str:
    """Return the command that makes the same report."""
    words = ["kitchenmind", "report", export.folder.name, "--study", export.study]
    words += ["--study-version", str(export.version)] if export.version is not None else []
    chosen = options.questionnaire_layouts
    words += ["--questionnaire-layouts", *chosen] if chosen else []
    return shlex.join([*words, "--seed", str(options.seed)])


def _software(export: Export) -> str:
    """Return the version that made this page, and those that the games were played on."""
    try:
        here = f"kitchenmind {version('kitchenmind')}"
    except PackageNotFoundError:
        here = "kitchenmind"
    if "code_version" not in export.episodes.columns:
        return here
    played = ", ".join(sorted(str(name) for name in export.episodes["code_version"].drop_nulls().unique()))
    return f"{here}; played on {played}"


def fingerprint(folder: Path) -> str:
    """Return the SHA-256 of the tables that were read, in the order of their names: equal data give equal
    fingerprints."""
    digest = hashlib.sha256()
    for name in sorted(COLUMNS):
        path = table_file(folder, name)
        if path is not None:
            digest.update(hashlib.sha256(path.read_bytes()).digest())
    return digest.hexdigest()
