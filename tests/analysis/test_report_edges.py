"""Reports on unusual data: text that looks like numbers, rewards that do not vary, hostile names, two versions."""

import csv
import re
from collections.abc import Callable, Iterator
from html.parser import HTMLParser
from pathlib import Path

import polars as pl
import pytest

import kitchenmind
from analysis import apa_text, figure_style
from analysis.report import Report, write_report
from analysis.results import select
from analysis.study import Options
from analysis.synthetic import Truth, write_export
from analysis.tables import ExportError, read_export
from tests.analysis.test_report import copied
from tests.support.parameters import mostly_slow

Change = Callable[[str, pl.DataFrame], pl.DataFrame | None]
QUICK = Options(power_studies=20, draws=200)
SMALL = Truth(participants=4, layouts=("matrix", "double_rings"), timesteps=20, broken=0)


@pytest.fixture(scope="module", autouse=True)
def _coarse_pictures() -> Iterator[None]:
    """Draw coarse figures: thirty reports are made here, and their figures are not checked."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(figure_style, "DPI", 20)
        yield


@pytest.fixture(scope="module")
def small(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("small")
    write_export(SMALL, folder)
    return folder


@pytest.fixture(scope="module")
def plain(small: Path, tmp_path_factory: pytest.TempPathFactory) -> Report:
    return reported(small, tmp_path_factory.mktemp("plain"), lambda name, table: table)


def reported(folder: Path, tmp_path: Path, change: Change, options: Options = QUICK) -> Report:
    return write_report(copied(folder, tmp_path / "data", change), tmp_path / "out", options)


def with_texts(*texts: list[str]) -> Change:
    """Add free-text answers about every episode: a question for each list."""

    def change(name: str, table: pl.DataFrame) -> pl.DataFrame:
        if name != "answers":
            return table
        first = table.unique("episode", maintain_order=True)
        comments = [
            first.with_columns(
                pl.Series("value", [words[index % len(words)] for index in range(first.height)]),
                question=pl.lit(f"comment_{number}"),
                value_type=pl.lit("text"),
            ).select(table.columns)
            for number, words in enumerate(texts)
        ]
        return pl.concat([table, *comments])

    return change


@pytest.mark.usefixtures("no_pictures")
def test_free_text_is_never_a_number(small: Path, plain: Report, tmp_path: Path) -> None:
    texts = (["10", "12", "7"], ["nan"], ["inf", "1e5", "-3", "2 soups", ""], ["007"])
    made = reported(small, tmp_path, with_texts(*texts))
    assert not [row for row in made.analysis.rows if row.question.startswith("comment")]
    assert [repr(row) for row in made.analysis.rows] == [repr(row) for row in plain.analysis.rows]
    assert made.quality.read_bytes() == plain.quality.read_bytes()
    assert "comment" not in made.page.read_text(encoding="utf-8").lower()


def test_free_text_in_csv_is_never_a_number_and_names_keep_their_zeros(small: Path, tmp_path: Path) -> None:
    def change(name: str, table: pl.DataFrame) -> pl.DataFrame:
        table = with_texts(["10"])(name, table)  # type: ignore[assignment]
        people = [column for column in ("participant", "participant_0") if column in table.columns]
        return table.with_columns(pl.col(column).str.replace("^p", "") for column in people)

    folder = copied(small, tmp_path / "parquet", change)
    (tmp_path / "csv").mkdir()
    for path in folder.glob("*.parquet"):
        pl.read_parquet(path).write_csv(tmp_path / "csv" / f"study-x_{path.stem}_data.csv")
    export = read_export(tmp_path / "csv")
    assert export.participants["participant"][0] == "00000"
    assert export.episodes.height == SMALL.participants * 3 * 4
    assert not export.answers["question"].str.starts_with("comment").any()


def test_an_export_without_value_types_is_refused_with_the_remedy(small: Path, tmp_path: Path) -> None:
    def change(name: str, table: pl.DataFrame) -> pl.DataFrame:
        return table.drop("value_type") if name == "answers" else table

    with pytest.raises(ExportError, match=r"has no column value_type\. Export the study again"):
        reported(small, tmp_path, change)


def rewards(score: pl.Expr) -> Change:
    def change(name: str, table: pl.DataFrame) -> pl.DataFrame:
        return table.with_columns(score=score.cast(pl.Float64), progress=0.0) if name == "episodes" else table

    return change


CONSTANT = {
    "nothing": pl.lit(0),
    "always one soup": pl.lit(20),
    "by condition": pl.when(pl.col("condition") == "tom").then(40).otherwise(20),
    "by person": pl.col("participant_0").str.slice(-2).cast(pl.Int64),
    "by layout": pl.when(pl.col("layout") == "matrix").then(40).otherwise(20),
    "rounding": pl.lit(20.0) + pl.int_range(pl.len()) * 1e-13,
    "one soup once": pl.when(pl.int_range(pl.len()) == 3).then(20).otherwise(0),
    "not recorded": pl.lit(None),
}
DRAWN = ("nothing", "one soup once", "not recorded")  # the oddest axes; the figures of the others are built only


@pytest.mark.parametrize("case", mostly_slow(CONSTANT))
def test_every_test_that_cannot_be_computed_gives_its_reason_and_the_rest_is_written(
    case: str, small: Path, tmp_path: Path, request: pytest.FixtureRequest
) -> None:
    if case not in DRAWN:
        request.getfixturevalue("no_pictures")
    made = reported(small, tmp_path, rewards(CONSTANT[case]))
    rows = made.analysis.rows
    untested = [row for row in rows if row.test not in NO_TEST and row.p != row.p]
    assert all(row.note for row in untested), [row.test for row in untested if not row.note]
    assert all(abs(row.p) <= 1 for row in rows if row.p == row.p)
    assert select(rows, section="questionnaire", test="t_test_people"), "the rest is written"
    text = made.page.read_text(encoding="utf-8")
    assert "2. Reward</h2>" in text
    assert "Sentences to paste" in text
    assert not re.search(r"\bnan\b", re.sub(r"<svg.*?</svg>", "", text, flags=re.DOTALL))
    said = " ".join([*apa_text.findings(made.analysis), *apa_text.sentences(made.analysis)])
    assert not re.search(r"\bnan\b", said)
    if case in ("nothing", "always one soup"):
        assert "could not be compared by reward: no variance within the conditions" in said
        assert "mixed model" not in said
        assert made.analysis.powers == ()
        assert "No mixed model: it could not be fitted" in text


NO_TEST = {
    "mean", "live", "offline", "person_sd", "residual_sd", "icc", "people", "comparison", "some", "assigned", "left",
    "excluded", "analysed", "played", "unfinished", "removed", "of_incomplete", "of_excluded", "not_analysed",
    "slope_sd",
}  # fmt: skip


@pytest.mark.usefixtures("no_pictures")
def test_without_a_fitted_model_there_is_no_sentence_and_no_power_curve(small: Path, tmp_path: Path) -> None:
    def change(name: str, table: pl.DataFrame) -> pl.DataFrame:
        own = (pl.col("condition") == "tom") == (pl.col("agent_1") == "sp")  # conditions and agents are one
        return table.filter(own) if name == "episodes" else table

    made = reported(small, tmp_path, change)
    assert "cannot be separated" in select(made.analysis.rows, test="fixed_effect")[0].note
    assert made.analysis.powers == ()
    assert not any("mixed model" in text for text in apa_text.sentences(made.analysis))


HOSTILE = '<img src=x onerror="alert(1)">&$_$'


class Tags(HTMLParser):
    """Every tag of a page with its attributes."""

    def __init__(self) -> None:
        super().__init__()
        self.found: list[tuple[str, list[str]]] = []

    def handle_starttag(self, tag: str, attributes: list[tuple[str, str | None]]) -> None:
        self.found.append((tag, [name for name, _ in attributes]))


COLUMNS = ("agent_1", "condition", "layout", "question", "study", "participant", "participant_0")


def test_no_name_gets_into_the_page_as_markup(small: Path, tmp_path: Path) -> None:
    def change(name: str, table: pl.DataFrame) -> pl.DataFrame:
        if name == "episodes":
            table = table.with_columns(excluded=pl.when(pl.int_range(pl.len()) < 2).then(pl.lit(HOSTILE)))
        return table.with_columns(
            (pl.col(column) + pl.lit(HOSTILE)).alias(column) for column in COLUMNS if column in table.columns
        )

    text = reported(small, tmp_path, change).page.read_text(encoding="utf-8")
    tags = Tags()
    tags.feed(text)
    assert "img" not in [tag for tag, _ in tags.found]
    assert not [attribute for _, names in tags.found for attribute in names if attribute.startswith("on")]
    assert text.lower().count("&lt;img") > 50


FORMULA = "=1+1"


@pytest.mark.usefixtures("no_pictures")
def test_no_name_is_run_as_a_formula_where_a_csv_file_is_opened(small: Path, tmp_path: Path) -> None:
    def change(name: str, table: pl.DataFrame) -> pl.DataFrame:
        return table.with_columns(
            (pl.lit(FORMULA) + pl.col(column)).alias(column) for column in COLUMNS if column in table.columns
        )

    made = reported(small, tmp_path, change)
    for path in (made.results, made.quality):
        cells = [cell for row in csv.reader(path.read_text(encoding="utf-8").splitlines()) for cell in row]
        assert [cell for cell in cells if cell.startswith("=")] == []
        assert any(cell.startswith(f"'{FORMULA}") for cell in cells), "the names are there"


def two_versions(name: str, table: pl.DataFrame) -> pl.DataFrame:
    """The first three participants came before the study file changed."""
    return (
        table.with_columns(study_version=pl.when(pl.int_range(pl.len()) < 3).then(1).otherwise(2))
        if (name == "participants")
        else table
    )


@pytest.mark.usefixtures("quick_command")
@pytest.mark.slow
def test_two_versions_are_named_and_one_can_be_chosen(
    small: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    folder = copied(small, tmp_path / "data", two_versions)
    (folder / "studies").mkdir()
    for version in (1, 2):
        text = f"title: {{en: Version {version}}}\nconditions: [{{name: tom}}]\nlayouts: [name: matrix]\n"
        (folder / "studies" / f"simulated_version-{version}.yaml").write_text(text)
    words = ["report", str(folder), "--out", str(tmp_path / "out")]
    notice = "analysed together: version 1 (3 simulated participants) and version 2 (9 simulated participants)"
    assert kitchenmind.main(words) == 0
    assert notice in capsys.readouterr().err
    assert notice in (tmp_path / "out" / "report.html").read_text(encoding="utf-8")
    assert kitchenmind.main([*words, "--study-version", "2"]) == 0
    assert capsys.readouterr().err == ""
    text = (tmp_path / "out" / "report.html").read_text(encoding="utf-8")
    assert "analysed together" not in text
    assert "9 analysed" in text
    assert "--study-version 2" in text
    assert read_export(folder, version=1).about["title"] == "Version 1"
    assert read_export(folder).about["title"] == "Version 2"
    power = ["power", str(folder), "--effect", "5", "--studies", "20", "--out", str(tmp_path / "power")]
    assert kitchenmind.main(power) == 0
    assert notice in capsys.readouterr().err
    assert kitchenmind.main([*power, "--study-version", "2"]) == 0
    assert capsys.readouterr().err == ""
    assert kitchenmind.main([*words, "--study-version", "3"]) == 2
    assert "no version 3 of this study. It has: 1, 2." in capsys.readouterr().err


@pytest.mark.usefixtures("quick_command")
def test_a_single_version_is_not_mentioned(small: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert kitchenmind.main(["report", str(small), "--out", str(tmp_path)]) == 0
    assert capsys.readouterr().err == ""


def drawn(path: Path) -> dict[tuple[str, str, str], tuple[str, str, str]]:
    """What is drawn at random, by test: p of permutations, bounds of bootstraps, power."""
    with path.open(encoding="utf-8", newline="") as stream:
        rows = [row for row in csv.DictReader(stream) if "draws" in row["note"] or row["section"] == "power"]
    return {
        (row["test"], row["agent"], row["n"] + row["note"]): (row["p"] + row["estimate"], row["ci_low"], row["ci_high"])
        for row in rows
    }


@pytest.mark.usefixtures("no_pictures")
@pytest.mark.slow
def test_the_seed_seeds_everything_that_is_drawn(planted_folder: Path, tmp_path: Path) -> None:
    first, again, other = (
        drawn(write_report(planted_folder, tmp_path / name, Options(draws=200, power_studies=50, seed=seed)).results)
        for name, seed in (("first", 1), ("again", 1), ("other", 2))
    )
    assert first == again
    kinds = {key[0] for key in first}
    assert kinds >= {"kruskal_wallis", "kruskal_wallis_people", "contrast_by_layout", "contrast_by_agent", "people"}
    for kind in kinds - {"kruskal_wallis_people"}:  # p of a planted effect is the smallest there is, whatever is drawn
        changed = [first[key] != other[key] for key in first if key[0] == kind and key in other]
        assert any(changed), kind


@pytest.mark.usefixtures("quick_command")
@pytest.mark.slow
def test_the_command_in_the_report_makes_the_report_again(
    small: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    words = ["report", str(small), "--questionnaire-layouts", "matrix", "--seed", "5", "--out", str(tmp_path / "one")]
    assert kitchenmind.main(words) == 0
    text = (tmp_path / "one" / "report.html").read_text(encoding="utf-8")
    found = re.search(r"kitchenmind report ([^<]+)<", text)
    assert found
    monkeypatch.chdir(small.parent)
    assert kitchenmind.main(["report", *found[1].split(), "--out", str(tmp_path / "two")]) == 0
    assert (tmp_path / "two" / "results.csv").read_bytes() == (tmp_path / "one" / "results.csv").read_bytes()


@pytest.mark.usefixtures("no_pictures")
def test_draws_and_the_number_of_corrected_tests_are_reported(small: Path, tmp_path: Path) -> None:
    def change(name: str, table: pl.DataFrame) -> pl.DataFrame:
        if name != "episodes":
            return table
        flat = (pl.col("layout") == "matrix") & (pl.col("agent_1") == "sp")
        return table.with_columns(
            score=pl.when(flat).then(0.0).otherwise(pl.col("score")),
            progress=pl.when(flat).then(0.0).otherwise(pl.col("progress")),
        )

    made = reported(small, tmp_path, change, Options(draws=300, power_studies=20))
    text = made.page.read_text(encoding="utf-8")
    assert "(300 draws)" in text
    assert "(300 bootstrap draws)" in text
    assert "Benjamini-Hochberg correction over 3." in text  # of four, one of which nobody scored in
    assert "no variance within the conditions" in text


@pytest.mark.parametrize("file", ["about.json", "answers.parquet"])
def test_a_damaged_file_is_named(file: str, small: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    folder = copied(small, tmp_path / "data", lambda name, table: table)
    (folder / file).write_bytes(b"{ no table")
    assert kitchenmind.main(["report", str(folder), "--out", str(tmp_path / "out")]) == 2
    assert file in capsys.readouterr().err
    assert kitchenmind.main(["report", str(small), "--seed", "-1", "--out", str(tmp_path / "out")]) == 2
    assert "--seed is negative" in capsys.readouterr().err


@pytest.mark.usefixtures("no_pictures")
def test_episodes_of_a_place_played_twice_are_not_taken_for_two_people(small: Path, tmp_path: Path) -> None:
    def change(name: str, table: pl.DataFrame) -> pl.DataFrame:
        if name != "episodes":
            return table
        again = table.with_columns(episode=pl.col("episode") + "b", number=pl.col("number") + 4)
        return pl.concat([table, again])

    made = reported(small, tmp_path, change)
    published = select(made.analysis.rows, test="t_test", contrast="tom - none", section="reward")[0]
    people = select(made.analysis.rows, test="t_test_people", contrast="tom - none", section="reward")[0]
    assert (published.n, published.unit, people.n, people.unit) == (16, "episodes", 8, "people")
    assert people.df == 6
    assert people.estimate == pytest.approx(published.estimate)
    mean = select(made.analysis.rows, section="reward", test="mean", layout="matrix")[0]
    assert (mean.n, mean.unit) == (4, "people")
    assert "p, published" in made.page.read_text(encoding="utf-8")
