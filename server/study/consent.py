"""The consent page of a study file, and its other pages of text, as frozen models."""

import hashlib
from typing import Annotated

from pydantic import Field

from server.study.branching import When
from server.study.strict_model import StrictModel
from server.study.text import Text


class Fact(StrictModel):
    """One line of the consent page's summary."""

    label: Text
    """What the line is about, such as Time."""
    value: Text
    """What it says, such as 6 minutes."""


class Section(StrictModel):
    """A heading with Markdown below it."""

    title: Text
    """The heading."""
    body: Text
    """The text below it, in Markdown."""


class TextPage(Section):
    """A page of text between the other steps."""

    when: When | None = None
    """Show the page only after a certain answer on an earlier page. Empty: always."""


class Consent(StrictModel):
    """The consent page. Nothing is stored before a participant agrees."""

    title: Text
    """The heading of the page."""
    lead: Text
    """The first paragraph."""
    facts: Annotated[tuple[Fact, ...], Field(max_length=6)] = ()
    sections: Annotated[tuple[Section, ...], Field(min_length=1)]
    boxes: Annotated[tuple[Text, ...], Field(min_length=1)]
    """The statements that a participant must tick."""

    @property
    def fingerprint(self) -> str:
        """What names this text in the page's form: another text, in any language, has another one."""
        return hashlib.sha256(self.model_dump_json().encode()).hexdigest()[:16]
