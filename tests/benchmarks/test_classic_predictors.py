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


def test_what_has_the_same_weights_is_not_measured_again():
    people, observers = benchmark.still_right(FIGURES)
    assert {(*cell, human, observers[cell[:2]]) for cell, human in people.items()} == {
        tuple(entry[key] for key in ("layout", "agent", "form", "human", "observer")) for entry in FIGURES["predictors"]
    }


def test_what_depends_on_other_weights_is_measured_again():
    agent, proxy, predictor = (
        "cramped_room/sp",
        "asymmetric_advantages/human_bc",
        "coordination_ring/sp_predictor_stream",
    )
    other = {**FIGURES["sha256"], agent: "0", proxy: "0", predictor: "0"}
    people, observers = benchmark.still_right({**FIGURES, "sha256": other})
    assert ("cramped_room", "sp") not in observers
    assert {layout for layout, _ in observers} == set(benchmark.LAYOUTS) - {"asymmetric_advantages"}
    assert ("cramped_room", "sp", "stream") not in people
    assert ("coordination_ring", "sp", "stream") not in people
    assert people.keys() >= {("cramped_room", "fcp", "stream"), ("coordination_ring", "fcp", "stream")}
    assert benchmark.still_right({}) == ({}, {})


def test_every_classic_kitchen_has_stream_predictors_of_both_agents():
    measured = {(entry["layout"], entry["agent"]) for entry in FIGURES["predictors"] if entry["form"] == "stream"}
    assert measured == {(layout, agent) for layout in benchmark.LAYOUTS for agent in ("sp", "fcp")}


def test_a_predictor_that_is_not_bundled_is_shown_as_missing():
    left = [entry for entry in FIGURES["predictors"] if entry["layout"] != "cramped_room"]
    rows = benchmark.rendered({"predictors": left}).splitlines()
    assert {row.split(" | ")[1] for row in rows[3:-1]} == {"–"}
