"""The guide for R, run by R: its lines read an export as polars does."""

import re
import shutil
import subprocess
from pathlib import Path

import polars as pl
import pytest

import kitchenmind
from server.store.database import Database
from tests.support.databases import with_tables
from tests.support.study_data import fill

GUIDE = Path(__file__).parent.parent / "docs" / "guides" / "read_the_data_in_r.md"
BLOCKS = re.findall(r"^```r\n(.*?)^```", GUIDE.read_text("utf-8"), re.MULTILINE | re.DOTALL)
PARQUET, CSV, PLAYED, COLUMNS, ROWS = BLOCKS
PRINTED = """
scores <- played |> group_by(condition) |> summarise(episodes = n(), score = sum(score))
cat(sprintf("%s %d %d\n", scores$condition, scores$episodes, scores$score), sep = "")
cat(class(episodes$started_at), class(episodes$score), class(participants$simulated), "\n")
cat(format(min(episodes$started_at), "%Y-%m-%d %H:%M:%S %Z"), "\n")
"""


def has_packages(*names: str) -> bool:
    if shutil.which("Rscript") is None:
        return False
    wanted = ", ".join(f"requireNamespace('{name}', quietly = TRUE)" for name in names)
    return subprocess.run(["Rscript", "-e", f"quit(status = !all({wanted}))"], capture_output=True).returncode == 0


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with an export called `export`, as in the guide."""
    folder = tmp_path_factory.mktemp("r")
    url = with_tables(folder / "study.sqlite3")
    with Database(url) as database:
        database.write_now(fill)
    assert kitchenmind.main(["export", "--database", url, "--out", str(folder / "export")]) == 0
    return folder


@pytest.mark.skipif(not has_packages("dplyr", "jsonlite"), reason="needs R with dplyr and jsonlite")
@pytest.mark.parametrize("reader", ["csv", "nanoparquet", "arrow"])
def test_the_lines_of_the_guide_read_an_export(folder: Path, reader: str) -> None:
    if reader != "csv" and not has_packages(reader):
        pytest.skip(f"needs the R package {reader}")
    begin = (
        CSV if reader == "csv" else PARQUET.replace("nanoparquet ", f"{reader} ").replace("nanoparquet)", f"{reader})")
    )
    more = {"csv": "", "nanoparquet": COLUMNS, "arrow": COLUMNS + ROWS}[reader]
    script = folder / f"{reader}.R"
    script.write_text(f"{begin}\n{PLAYED}\n{PRINTED}\n{more}", encoding="utf-8")
    done = subprocess.run(["Rscript", str(script)], cwd=folder, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    episodes = pl.read_parquet(folder / "export" / "parquet" / "episodes.parquet")
    people = pl.read_parquet(folder / "export" / "parquet" / "participants.parquet").filter(status="completed")
    played = episodes.filter(pl.col("participant_0").is_in(people["participant"].implode()), kind="episode")
    assert played.height > 0
    ((condition, score),) = played.group_by("condition").agg(pl.col("score").sum()).rows()
    assert f"{condition} {played.height} {score}\n" in done.stdout
    assert "POSIXct POSIXt" in done.stdout
    began = episodes["started_at"].min()
    assert f"{began:%Y-%m-%d %H:%M:%S} UTC" in done.stdout
