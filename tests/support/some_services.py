"""Services for an application that a test builds by hand, from the parts that the test needs."""

from dataclasses import fields
from types import SimpleNamespace
from typing import Any

from server.web.rate_limits import Rates
from server.web.services import Services

UNCHANGED = SimpleNamespace(changed={}, find_changes=lambda: None, file_of=lambda _: None)  # nobody edits study files


def some_services(**parts: Any) -> Services:
    """Return services that have only these parts; using another one fails."""
    return Services(
        **{field.name: None for field in fields(Services)} | {"versions": UNCHANGED, "rates": Rates()} | parts
    )
