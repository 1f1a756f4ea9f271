"""Fixtures of the researchers' pages."""

from tests.support.researcher_site import site as site
