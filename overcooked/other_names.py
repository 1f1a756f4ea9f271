"""The names of bundled layouts in overcooked_ai and older papers."""

from typing import Final

OTHER_NAMES: Final = {
    "simple": "cramped_room",
    "unident_s": "asymmetric_advantages",
    "random0": "forced_coordination",
    "random1": "coordination_ring",
    "random3": "counter_circuit",
    "counter_circuit_o_1order": "counter_circuit",
}


def bundled_name(name: str) -> str:
    """Return the layout's name in this project and its data."""
    return OTHER_NAMES.get(name, name)
