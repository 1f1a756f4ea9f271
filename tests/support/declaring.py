"""Exports of simulated studies whose study file declares something."""

import shutil
from pathlib import Path

import polars as pl

HEAD = "title: {en: Declared}\n"


def declaring(folder: Path, out: Path, *texts: str) -> Path:
    """Copy the export; its study file has one version for each text, and participants are spread over them."""
    shutil.copytree(folder, out)
    (out / "studies").mkdir()
    for number, text in enumerate(texts, start=1):
        (out / "studies" / f"simulated_version-{number}.yaml").write_text(HEAD + text, encoding="utf-8")
    path = out / "participants.parquet"
    people = pl.read_parquet(path)
    version = (pl.int_range(pl.len()) % len(texts) + 1).alias("study_version")
    people.with_columns(version).write_parquet(path)
    return out
