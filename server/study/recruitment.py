"""Where participants come from and what they carry back, as a study file says it. Knows no web."""

import re
from typing import Annotated, Literal

from pydantic import Field, field_validator

from server.study.strict_model import StrictModel

# What the recruiters' ids look like; MTurk's is from the reference of its API.
_PERSON_PATTERNS = {"prolific": "[0-9a-f]{24}", "mturk": "A[A-Z0-9]{1,63}", "sona": "[A-Za-z0-9_-]{1,64}"}


class Exit(StrictModel):
    """What somebody gets who leaves the study in one of its ways."""

    code: Annotated[str, Field(pattern=r"^[A-Za-z0-9-]{4,40}$")] | None = None
    """A fixed code, as Prolific wants it. Empty: everybody who finishes gets their own."""
    url: Annotated[str, Field(pattern=r"^https://[A-Za-z0-9.-]+(:\d+)?(/.*)?$")] | None = None
    """Where the last page leads. {code}, {person} and the names of `recruitment.extra` are filled in."""


class Recruitment(StrictModel):
    """Where participants come from: the parameters of their link, and what they carry back."""

    source: Literal["none", "prolific", "mturk", "sona"] = "none"
    person: str | None = None
    """The link's parameter that names the person. Empty: the source's usual one."""
    extra: tuple[str, ...] | None = None
    """Further parameters that are kept. Empty: the source's usual ones."""
    person_pattern: str | None = None
    """A regular expression that the person's id matches as a whole. Empty: the source's usual one."""
    required: bool = False
    """Refuse a link without the person's parameter."""
    completed: Exit = Exit()
    screened_out: Exit = Exit()
    unpaired: Exit = Exit()
    """For those who waited for another person in vain, where `waiting_room.fallback` is `leave`."""
    declined: Exit = Exit()

    @property
    def person_parameter(self) -> str | None:
        usual = {"none": None, "prolific": "PROLIFIC_PID", "mturk": "workerId", "sona": "survey_code"}
        return self.person or usual[self.source]

    def person_of(self, value: str) -> str | None:
        """Return the person's id, None for a value that is not one of the recruiter's ids."""
        pattern = self.person_pattern
        if pattern is None:
            value = value.lower() if self.source == "prolific" else value
            pattern = _PERSON_PATTERNS.get(self.source, ".+")
        return value if re.fullmatch(pattern, value) else None

    @field_validator("person_pattern")
    @classmethod
    def _pattern_can_be_used(cls, pattern: str | None) -> str | None:
        try:
            re.compile(pattern or "")
        except re.error as error:
            raise ValueError(f"person_pattern: {pattern!r} is not a regular expression ({error})") from None
        return pattern

    @property
    def extra_parameters(self) -> tuple[str, ...]:
        usual = {"prolific": ("STUDY_ID", "SESSION_ID"), "mturk": ("assignmentId", "hitId", "turkSubmitTo")}
        return usual.get(self.source, ()) if self.extra is None else self.extra
