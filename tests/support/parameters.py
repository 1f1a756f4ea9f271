"""Values of a parametrized test of which every run takes only the first."""

from collections.abc import Iterable
from typing import Any

import pytest


def mostly_slow(values: Iterable[Any]) -> list[Any]:
    """Return the values for `parametrize`: `make test` takes the first, `make test-slow` the others. A value is what
    `parametrize` expects, so a tuple where the test has several arguments."""
    first, *others = values
    return [
        first,
        *(pytest.param(*(one if isinstance(one, tuple) else (one,)), marks=pytest.mark.slow) for one in others),
    ]
