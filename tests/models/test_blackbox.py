"""Agents and predictors from outside, by name: which kinds there are, and which are refused."""

import pytest

from models.agents.blackbox import BlackBoxError, load_foreign_predictor
from overcooked.layout import load_layout

RING = load_layout("coordination_ring")


def test_a_predictor_cannot_be_an_address():
    with pytest.raises(BlackBoxError, match="Give an ONNX file"):
        load_foreign_predictor("http://127.0.0.1:1/", RING)
