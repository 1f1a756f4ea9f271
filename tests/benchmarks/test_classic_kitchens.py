"""The table of the classic kitchens in docs/explanation/results.md shows the figures of the bundled agents."""

import importlib.util
import json
from pathlib import Path

import pytest

from training.behaviour_cloning import RECORDED

ROOT = Path(__file__).parent.parent.parent
spec = importlib.util.spec_from_file_location("classic_benchmark", ROOT / "benchmarks" / "classic_kitchens.py")
classic = importlib.util.module_from_spec(spec)
spec.loader.exec_module(classic)

FIGURES = json.loads(classic.FIGURES.read_text(encoding="utf-8"))
REMEDY = "Run: python benchmarks/classic_kitchens.py --write"


def test_the_document_shows_the_figures_of_the_bundled_agents():
    assert classic.rendered(FIGURES) in classic.DOCUMENT.read_text(encoding="utf-8"), REMEDY
    assert classic.bundled_agents() == FIGURES["sha256"], REMEDY
    assert {f"{entry['layout']}/{entry['agent']}" for entry in FIGURES["agents"]} == set(FIGURES["sha256"])


def test_every_classic_kitchen_has_a_human_proxy_and_published_figures():
    assert set(classic.LAYOUTS) == set(RECORDED) == set(classic.PUBLISHED)
    assert {f"{layout}/human_bc" for layout in classic.LAYOUTS} <= set(FIGURES["sha256"])
    for seeds in classic.PUBLISHED.values():
        assert [len(values) for values in seeds] == [5, 5, 5]
        assert all(points % 0.5 == 0 for values in seeds for points in values)  # a mean of 40 games, 20 a soup


def test_the_published_figures_are_summed_up_as_their_authors_do():
    """Mean, and population standard deviation over the root of the number of seeds."""
    assert classic._over_seeds((199.0, 182.0, 208.0, 199.5, 205.5)) == "199 ± 4"
    assert classic._published_seats("coordination_ring") == "67 / 73"


def test_fcp_earns_more_with_the_human_proxy_than_self_play_in_coordination_ring():
    ring = {entry["agent"]: entry for entry in FIGURES["agents"] if entry["layout"] == "coordination_ring"}
    sp, fcp = ring["sp"]["with_partner"], ring["fcp"]["with_partner"]
    assert fcp["mean"] - sp["mean"] > 2 * (sp["se"] + fcp["se"])


@pytest.mark.parametrize("agent", ["sp", "fcp"])
def test_a_missing_agent_is_shown_as_missing(agent):
    left = [one for one in FIGURES["agents"] if one["agent"] != agent]
    assert f"**{agent.upper()}, with itself** | – | – | – | – | – |" in classic.rendered({"agents": left})
