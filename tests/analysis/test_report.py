"""The report: complete, self-contained in one file, and explicit about missing data."""

import csv
import math
import re
import xml.etree.ElementTree as ElementTree
from collections.abc import Callable
from pathlib import Path

import polars as pl
import pytest

import kitchenmind
from analysis import apa_text, formatting
from analysis.groups import main_contrast
from analysis.provenance import fingerprint
from analysis.report import Report, write_report
from analysis.results import COLUMNS, Result, select
from analysis.study import Options
from analysis.synthetic import Truth, write_export
from analysis.tables import ExportError, read_export

QUICK = Options(power_studies=50)
FIGURES = ("reward", "effect_sizes", "questionnaire", "accuracy", "power", "residuals")


@pytest.fixture(scope="module")
def report(planted_folder: Path, tmp_path_factory: pytest.TempPathFactory) -> Report:
    return write_report(planted_folder, tmp_path_factory.mktemp("report"), QUICK)


@pytest.fixture(scope="module")
def page(report: Report) -> str:
    return report.page.read_text(encoding="utf-8")


def copied(folder: Path, out: Path, change: Callable[[str, pl.DataFrame], pl.DataFrame | None]) -> Path:
    """The export with its tables changed, or left out where `change` gives nothing."""
    out.mkdir()
    for path in folder.glob("*.parquet"):
        table = change(path.stem, pl.read_parquet(path))
        if table is not None:
            table.write_parquet(out / path.name)
    return out


def test_the_page_stands_alone(page: str) -> None:
    addresses = set(re.findall(r"https?://[^\s\"'<>)]+", page))
    assert all(address.startswith("http://www.w3.org/") for address in addresses)  # names of XML vocabularies
    assert '<link rel="stylesheet"' not in page
    assert page.count("<svg") == len(FIGURES)
    ids = re.findall(r'\bid="([^"]+)"', page)
    assert len(ids) == len(set(ids)), "two figures share an id"


def test_every_section_has_its_numbers(page: str) -> None:
    for heading in ("Who and what is in", "Reward", "Questionnaire", "Was the predictor right?", "Sentences to paste"):
        assert f". {heading}</h2>" in page
    assert 'class="missing"' not in page
    assert "nan" not in re.sub(r"<svg.*?</svg>", "", page, flags=re.DOTALL)


def test_simulated_data_are_marked_as_simulated(page: str) -> None:
    assert "Simulated: this data set holds simulated players" in page


def test_results_hold_every_number_of_the_page(report: Report, page: str) -> None:
    with report.results.open(encoding="utf-8", newline="") as stream:
        rows = list(csv.DictReader(stream))
    assert tuple(rows[0]) == COLUMNS
    assert len(rows) == len(report.analysis.rows)
    assert {row["section"] for row in rows} == {
        "exclusions", "reward", "mixed model", "assumptions", "questionnaire", "accuracy", "power", "sensitivity",
        "attrition", "ordinal", "robustness", "simple effects",
    }  # fmt: skip
    text = re.sub(r"<svg.*?</svg>|<style.*?</style>|<script.*?</script>", "", page, flags=re.DOTALL)
    shown = [float(cell.replace("−", "-")) for cell in re.findall(r'<td class="num">([+−]?\d+\.\d+)</td>', text)]
    assert len(shown) > 150
    columns = ("estimate", "statistic", "effect", "df", "df_residual", "se")
    known = {float(row[name]) for row in rows for name in columns if row[name]}
    known |= {100 * value for value in known}
    known |= _differences_between_live_and_offline(rows)
    for number in shown:
        assert any(abs(number - value) <= 0.0501 for value in known), number


def _differences_between_live_and_offline(rows: list[dict[str, str]]) -> set[float]:
    kept = [row for row in rows if row["section"] == "accuracy" and row["step"] == "0"]
    offline = {(row["agent"], row["layout"]): float(row["estimate"]) for row in kept if row["test"] == "offline"}
    return {
        100 * (float(row["estimate"]) - offline[row["agent"], row["layout"]])
        for row in kept
        if row["test"] == "live" and row["condition"] == "all"
    }


def test_figures_are_written_as_svg_and_png(report: Report) -> None:
    folder = report.page.parent / "figures"
    for name in FIGURES:
        assert ElementTree.parse(folder / f"{name}.svg").getroot().tag.endswith("svg")
        assert (folder / f"{name}.png").read_bytes().startswith(b"\x89PNG")


def test_excluded_episodes_are_listed_with_their_reason(report: Report, page: str) -> None:
    excluded = report.analysis.quality.filter(pl.col("excluded") != "")
    assert excluded.height > 0
    for episode in excluded["episode"]:
        assert re.search(rf"{episode}</td>.*out: technical fault", page)


def test_the_same_data_give_the_same_numbers_and_fingerprint(
    report: Report, planted_folder: Path, tmp_path: Path
) -> None:
    again = write_report(planted_folder, tmp_path, QUICK)
    assert again.results.read_bytes() == report.results.read_bytes()
    assert fingerprint(planted_folder)[:32] in again.page.read_text(encoding="utf-8")
    figure = Path("figures") / "reward.svg"
    assert (tmp_path / figure).read_bytes() == (report.page.parent / figure).read_bytes()


@pytest.mark.usefixtures("no_pictures")
@pytest.mark.slow
def test_csv_files_have_the_same_values_as_parquet(report: Report, planted_folder: Path, tmp_path: Path) -> None:
    folder = tmp_path / "data"
    folder.mkdir()
    for path in planted_folder.glob("*.parquet"):
        pl.read_parquet(path).write_csv(folder / f"study-simulated_{path.stem}_data.csv")
    (tmp_path / "about.json").write_bytes((planted_folder / "about.json").read_bytes())
    from_csv = write_report(tmp_path, tmp_path / "out", QUICK).analysis.rows
    assert [repr(row) for row in from_csv] == [repr(row) for row in report.analysis.rows]


@pytest.mark.usefixtures("no_pictures")
def test_one_condition_alone_is_described_and_not_compared(planted_folder: Path, tmp_path: Path) -> None:
    def change(name: str, table: pl.DataFrame) -> pl.DataFrame:
        return table.filter(pl.col("condition") == "tom") if name in ("participants", "episodes") else table

    made = write_report(copied(planted_folder, tmp_path / "data", change), tmp_path / "out", QUICK)
    text = made.page.read_text(encoding="utf-8")
    assert "Only one condition has episodes" in text
    assert "Only one condition answered" in text
    assert "No mixed model: it needs two conditions" in text
    assert select(made.analysis.rows, test="mean", condition="tom")


@pytest.mark.usefixtures("no_pictures")
def test_missing_predictions_and_answers_are_said_plainly(planted_folder: Path, tmp_path: Path) -> None:
    def change(name: str, table: pl.DataFrame) -> pl.DataFrame:
        if name == "ticks":
            return table.with_columns(pl.lit(None, dtype=pl.Int8).alias(f"predicted_{step}") for step in (1, 2, 3))
        return table.clear() if name == "answers" else table

    text = write_report(copied(planted_folder, tmp_path / "data", change), tmp_path / "out", QUICK).page.read_text(
        "utf-8"
    )
    assert "No predictions are recorded" in text
    assert "No answers on" in text


def test_a_study_that_nobody_finished_gives_a_page_without_numbers(planted_folder: Path, tmp_path: Path) -> None:
    def change(name: str, table: pl.DataFrame) -> pl.DataFrame:
        return table.with_columns(status=pl.lit("active")) if name == "participants" else table

    made = write_report(copied(planted_folder, tmp_path / "data", change), tmp_path / "out", QUICK)
    text = made.page.read_text(encoding="utf-8")
    assert "There is too little data for a comparison yet." in text
    assert "No finished episodes yet" in text


@pytest.mark.usefixtures("no_pictures")
def test_two_people_a_condition_are_reported_without_a_crash(tmp_path: Path) -> None:
    write_export(Truth(participants=2, layouts=("matrix",), agents=("sp",), timesteps=20, broken=0), tmp_path / "data")
    made = write_report(tmp_path / "data", tmp_path / "out", QUICK)
    assert made.analysis.episodes.height == 6
    assert all(not math.isinf(row.p) for row in made.analysis.rows)


@pytest.mark.usefixtures("no_pictures")
def test_other_conditions_than_the_published_are_compared_last_with_first(tmp_path: Path) -> None:
    truth = Truth(participants=4, conditions=("weak", "strong"), layouts=("matrix",), timesteps=20)
    write_export(truth, tmp_path / "data")
    made = write_report(tmp_path / "data", tmp_path / "out", QUICK)
    assert made.analysis.contrast == ("strong", "weak") == main_contrast(("weak", "strong"))
    assert "Strong against Weak" in made.page.read_text(encoding="utf-8")


def test_the_study_file_of_the_export_gives_title_and_order(planted_folder: Path, tmp_path: Path) -> None:
    folder = copied(planted_folder, tmp_path / "data", lambda name, table: table)
    (folder / "studies").mkdir()
    for version, title in ((9, "Old"), (10, "Cooking with arrows")):
        text = f"title: {{en: {title}, zh: other}}\nconditions: [{{name: tom}}, {{name: none}}]\n"
        text += "layouts: [name: matrix]\n"
        (folder / "studies" / f"simulated_version-{version}.yaml").write_text(text)
    export = read_export(folder)
    assert export.about["title"] == "Cooking with arrows"
    assert export.conditions == ("tom", "none", "random")
    assert export.layouts[0] == "matrix"
    (folder / "studies" / "simulated_version-11.yaml").write_text("- [")
    assert read_export(folder).conditions == ("none", "random", "tom")


@pytest.mark.parametrize(
    ("written", "shown"),
    [("1:30", "1:30"), ("7.50", "7.50"), ("no", "no"), ("[" * 5000, None)],
    ids=lambda words: str(words)[:5],
)
def test_the_title_stands_in_the_report_as_it_was_written(
    written: str, shown: str | None, planted_folder: Path, tmp_path: Path
) -> None:
    folder = copied(planted_folder, tmp_path / "data", lambda name, table: table)
    (folder / "studies").mkdir()
    (folder / "studies" / "simulated_version-1.yaml").write_text(f"title: {{en: {written}}}\n", encoding="utf-8")
    title = read_export(folder).about.get("title")
    assert title == shown


def test_several_studies_in_one_export_are_not_mixed(planted_folder: Path, tmp_path: Path) -> None:
    def change(name: str, table: pl.DataFrame) -> pl.DataFrame:
        if name != "participants":
            return table
        pilot = pl.when(pl.int_range(pl.len()) < 9).then(pl.lit("pilot")).otherwise(pl.col("study"))
        return table.with_columns(study=pilot)

    folder = copied(planted_folder, tmp_path / "data", change)
    with pytest.raises(ExportError, match="Choose one with --study: pilot, simulated"):
        read_export(folder)
    with pytest.raises(ExportError, match="holds no study other"):
        read_export(folder, "other")
    pilot = read_export(folder, "pilot")
    assert (pilot.participants.height, pilot.episodes.height) == (9, 90)
    assert set(pilot.ticks["episode"]) == set(pilot.episodes["episode"])


@pytest.mark.usefixtures("quick_command")
def test_the_verb_writes_a_report_about_the_chosen_layouts_and_names_it(
    planted_folder: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    words = ["report", str(planted_folder), "--questionnaire-layouts", "clear_division", "--out", str(tmp_path)]
    assert kitchenmind.main(words) == 0
    assert "report.html" in capsys.readouterr().out
    assert "interval, on Clear Division." in (tmp_path / "report.html").read_text(encoding="utf-8")
    assert kitchenmind.main(["report", str(planted_folder), "--questionnaire-layouts", "moon"]) == 2
    assert "no layout moon" in capsys.readouterr().err


@pytest.mark.parametrize("missing", ["episodes", "ticks"])
def test_a_folder_that_is_not_an_export_ends_with_status_two(
    missing: str, planted_folder: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    folder = copied(planted_folder, tmp_path / "data", lambda name, table: None if name == missing else table)
    assert kitchenmind.main(["report", str(folder), "--out", str(tmp_path / "out")]) == 2
    assert f"no table of {missing}" in capsys.readouterr().err
    assert kitchenmind.main(["report", str(tmp_path / "nowhere"), "--out", str(tmp_path / "out")]) == 2
    assert "is not a folder" in capsys.readouterr().err


def test_a_missing_column_is_named_with_its_file(planted_folder: Path, tmp_path: Path) -> None:
    def change(name: str, table: pl.DataFrame) -> pl.DataFrame:
        return table.drop("action_1") if name == "ticks" else table

    with pytest.raises(ExportError, match=r"ticks\.parquet has no column action_1"):
        read_export(copied(planted_folder, tmp_path / "data", change))


def test_sentences_agree_with_the_rows(report: Report) -> None:
    said = apa_text.sentences(report.analysis)
    row = select(report.analysis.rows, test="kruskal_wallis", agent="sp")[0]
    assert f"<i>H</i>(2, <i>n</i> = {row.n}) = {row.statistic:.2f}, <i>p</i> < .001" in said[1]
    assert f"{row.n} episodes of 48 simulated participants" in said[1]
    model = select(report.analysis.rows, test="fixed_effect", contrast="tom - none")[0]
    assert f"{model.estimate:.1f} points higher with ToM predictions than with no prediction" in said[3]
    assert any("was rated higher with SP (<i>t</i>(" in sentence for sentence in said)


def test_statistics_are_written_as_apa_wants_them() -> None:
    row = Result("reward", "t_test", statistic_name="t", statistic=-2.5, df=55, p=0.0155, n=57)
    assert apa_text.statistic(row) == "<i>t</i>(55) = −2.50, <i>p</i> = .015"
    welch = Result("reward", "anova", statistic_name="F", statistic=3.0, df=2, df_residual=54.93, p=0.0001)
    assert apa_text.statistic(welch) == "<i>F</i>(2, 54.9) = 3.00, <i>p</i> < .001"
    assert formatting.p_value(0.9999) == "> .999"
    assert formatting.signed(-0.04) == "0.0"
    assert formatting.number(math.nan) == "–"
    assert formatting.listed(["a", "b", "c"]) == "a, b and c"
