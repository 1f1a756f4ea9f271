"""The recruitment settings of a study file: where participants come from, and what they take back."""

import re
from typing import Annotated, Literal

from pydantic import Field, field_validator

from server.study.strict_model import StrictModel

# The format of the recruiters' ids; MTurk's is from the reference of its API.
_PERSON_PATTERNS = {"prolific": "[0-9a-f]{24}", "mturk": "A[A-Z0-9]{1,63}", "sona": "[A-Za-z0-9_-]{1,64}"}


class Exit(StrictModel):
    """The code and the link that the last page shows for one outcome."""

    code: Annotated[str, Field(pattern=r"^[A-Za-z0-9-]{4,40}$")] | None = None
    """A fixed completion code, as Prolific needs it. Empty: each participant who finishes gets a code of their own."""
    url: Annotated[str, Field(pattern=r"^https://[A-Za-z0-9.-]+(:\d+)?(/.*)?$")] | None = None
    """The link on the last page. {code}, {person} and the names in `recruitment.extra` are filled in."""


class Recruitment(StrictModel):
    """Where participants come from, and where they go at the end."""

    source: Literal["none", "prolific", "mturk", "sona"] = "none"
    """The recruitment service. It sets the defaults of the keys below."""
    person: str | None = None
    """The parameter of the study link that holds the participant's id. Empty: the service's usual one."""
    extra: tuple[str, ...] | None = None
    """Further parameters of the link to store. Empty: the service's usual ones."""
    person_pattern: str | None = None
    """A regular expression for the whole id. Empty: the service's usual one."""
    required: bool = False
    """Refuse a link without the participant's id."""
    completed: Exit = Exit()
    """For participants who finish the study."""
    screened_out: Exit = Exit()
    """For participants who fail the entry checks, the quiz or attention checks."""
    unpaired: Exit = Exit()
    """For participants whose partner does not arrive, if `waiting_room.fallback` is `leave`."""
    declined: Exit = Exit()
    """For participants who do not consent, or come when all places are taken or the study is closed."""

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
