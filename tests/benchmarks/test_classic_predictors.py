"""The table of predictors with a human proxy in docs/explanation/results.md shows the figures of the bundled ones."""

import importlib.util
import json
from pathlib import Path

ROOT = Path(__file__).parent.parent.parent
spec = importlib.util.spec_from_file_location("predictors_benchmark", ROOT / "benchmarks" / "classic_predictors.py")
benchmark = importlib.util.module_from_spec(spec)
spec.loader.exec_module(benchmark)

FIGURES = json.loads(benchmark.FIGURES.read_text(encoding="utf-8"))
REMEDY = "Run: python benchmarks/classic_predictors.py --write"


def test_the_document_shows_the_figures_of_the_bundled_predictors():
    assert benchmark.rendered(FIGURES) in benchmark.DOCUMENT.read_text(encoding="utf-8"), REMEDY
    assert benchmark.fingerprints() == FIGURES["sha256"], REMEDY


def test_every_classic_kitchen_has_stream_predictors_of_both_agents():
    measured = {(entry["layout"], entry["agent"]) for entry in FIGURES["predictors"] if entry["form"] == "stream"}
    assert measured == {(layout, agent) for layout in benchmark.LAYOUTS for agent in ("sp", "fcp")}


def test_a_predictor_that_is_not_bundled_is_shown_as_missing():
    left = [entry for entry in FIGURES["predictors"] if entry["layout"] != "cramped_room"]
    rows = benchmark.rendered({"predictors": left}).splitlines()
    assert {row.split(" | ")[1] for row in rows[3:-1]} == {"–"}
