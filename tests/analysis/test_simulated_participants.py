"""Simulated participants are never pooled with people, and everything made from them says what they are."""

import re
import shutil
from pathlib import Path

import polars as pl
import pytest

from analysis.report import Report, write_report
from analysis.simulated_participants import LABEL, without_pooling
from analysis.study import Options
from analysis.synthetic import Truth, write_export
from analysis.tables import read_export

QUICK = Options(draws=50, power_studies=10)


@pytest.fixture(scope="module")
def mixed(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, list[str]]:
    """An export of people and simulated participants, and the ids of the people."""
    folder = tmp_path_factory.mktemp("mixed")
    write_export(Truth(participants=5, timesteps=20), folder)
    (folder / "about.json").unlink()
    path = folder / "participants.parquet"
    table = pl.read_parquet(path)
    people = table["participant"].gather_every(2).to_list()
    table.with_columns(simulated=~pl.col("participant").is_in(people)).write_parquet(path)
    return folder, people


def test_simulated_participants_are_left_out_where_there_are_people(mixed: tuple[Path, list[str]]) -> None:
    folder, people = mixed
    export = read_export(folder)
    assert sorted(export.participants["participant"]) == sorted(people)
    assert set(export.episodes["participant"]) <= set(people)
    assert export.simulated_left_out == 15 - len(people)


@pytest.mark.slow
def test_a_report_on_people_gives_the_number_of_omitted_simulated_participants(
    mixed: tuple[Path, list[str]], tmp_path: Path
) -> None:
    folder, people = mixed
    report = write_report(folder, tmp_path, QUICK)
    page = report.page.read_text(encoding="utf-8")
    assert f"{15 - len(people)} simulated participants of this data set are left out" in page
    assert LABEL not in page
    assert set(report.analysis.episodes["participant"]) <= set(people)


@pytest.fixture(scope="module")
def rehearsal(tmp_path_factory: pytest.TempPathFactory) -> Report:
    """The report of simulated participants alone."""
    folder = tmp_path_factory.mktemp("rehearsal")
    write_export(Truth(participants=6, timesteps=20), folder / "export")
    return write_report(folder / "export", folder / "report", QUICK)


def test_every_figure_of_a_rehearsal_is_labelled_as_simulated(rehearsal: Report) -> None:
    figures = list((rehearsal.page.parent / "figures").glob("*.svg"))
    assert len(figures) >= 4
    assert [path.name for path in figures if LABEL not in path.read_text(encoding="utf-8")] == []
    assert "built so that foresight can help" in rehearsal.page.read_text(encoding="utf-8")


def test_no_sentence_of_a_rehearsal_speaks_of_people(rehearsal: Report) -> None:
    page = re.sub(r"<(style|svg).*?</\1>", "", rehearsal.page.read_text(encoding="utf-8"), flags=re.DOTALL)
    texts = [line for line in re.split(r"<[^<>]*>", page) if "evidence about people" not in line]
    spoken = [text for text in texts if re.search(r"(?i)\b(people|persons?|(?<!simulated )participants?)\b", text)]
    assert spoken == []
    assert "Simulated participants analysed" in texts


def withdrew(folder: Path, simulated: list[bool | None]) -> None:
    """Add participants of the first arm who withdrew: bots (True), people (False), or as an older export says it."""
    study = pl.read_parquet(folder / "participants.parquet").select("study", "condition").head(1)
    rows = pl.concat([study.with_columns(simulated=pl.lit(one, pl.Boolean)) for one in simulated])
    rows.write_parquet(folder / "withdrawals.parquet")


def test_bots_that_withdrew_are_not_counted_with_people(mixed: tuple[Path, list[str]], tmp_path: Path) -> None:
    folder = shutil.copytree(mixed[0], tmp_path / "export")
    withdrew(folder, [True, False, None])
    assert read_export(folder).withdrawals["simulated"].to_list() == [False, None]


def test_people_who_withdrew_are_not_counted_in_a_rehearsal(tmp_path: Path) -> None:
    write_export(Truth(participants=5, timesteps=20), tmp_path)
    withdrew(tmp_path, [True, False])
    assert read_export(tmp_path).withdrawals["simulated"].to_list() == [True]


def test_csv_has_words_instead_of_codes(mixed: tuple[Path, list[str]], tmp_path: Path) -> None:
    folder, people = mixed
    for path in folder.glob("*.parquet"):
        pl.read_parquet(path).write_csv(tmp_path / f"{path.stem}.csv")
    assert sorted(read_export(tmp_path).participants["participant"]) == sorted(people)


def test_where_everybody_withdrew_people_are_still_people() -> None:
    nobody = pl.DataFrame(schema={"participant": pl.String, "simulated": pl.Boolean})
    gone = pl.DataFrame({"condition": ["tom", "none"], "simulated": [False, True]})
    tables, left_out = without_pooling({"participants": nobody, "withdrawals": gone})
    assert tables["withdrawals"]["simulated"].to_list() == [False]
    assert left_out == 0
