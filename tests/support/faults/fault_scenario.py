"""One line of what the fault scenarios report: the same for tests and for benchmarks/faults.py."""

from dataclasses import dataclass, field
from typing import Any


@dataclass(frozen=True)
class FaultResult:
    """`row`: its number in docs/explanation/faults.md. `figure`: what was measured, by name with its unit."""

    row: int
    fault: str
    tries: int
    passed: bool
    figure: dict[str, Any] = field(default_factory=dict)

    def as_json(self) -> dict[str, Any]:
        return {"row": self.row, "fault": self.fault, "tries": self.tries, "figure": self.figure, "pass": self.passed}

    def hold(self) -> None:
        """Raise AssertionError with the figures if it did not pass."""
        assert self.passed, f"row {self.row}, {self.fault}: {self.figure}"


def rounded(value: float) -> float:
    return round(value, 3)
