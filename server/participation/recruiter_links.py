"""Recruiters' links: read their parameters, and build the address or form that leads back."""

import logging
import re
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Final
from urllib.parse import quote, unquote

from server.study.definition import Study
from server.study.recruitment import Exit, Recruitment

log = logging.getLogger(__name__)
MAX_PARAMETER_LENGTH = 128
MTURK_HOME: Final = "turkSubmitTo"
# All values that MTurk uses for `turkSubmitTo`. The value in the link only selects one of these.
MTURK_ORIGINS: Final = ("https://www.mturk.com", "https://workersandbox.mturk.com", "https://worker.mturk.com")
# {{%PROLIFIC_PID%}}, %SURVEY_CODE%, ${workerId}, {person}, <id>, [id]: placeholders that a recruiter should have
# replaced.
_PLACEHOLDER = re.compile(r"\{\{|\}\}|\$\{|^(%+\w+%+|\{.*\}|<.*>|\[.*\])$")
PREVIEW = "ASSIGNMENT_ID_NOT_AVAILABLE"  # MTurk's value in a preview


@dataclass(frozen=True)
class ReturnTarget:
    """The target of the last page: a link, or a form with hidden `fields` that is posted to `url`."""

    url: str
    fields: Mapping[str, str] | None = None

    @property
    def origin(self) -> str:
        """The scheme and host of `url`."""
        return "/".join(self.url.split("/", 3)[:3])


def recruitment_of(recruitment: Recruitment, given: Mapping[str, str]) -> tuple[str | None, dict[str, str]]:
    """Return the person's id and the other parameters that the study keeps, from a link's query or a form.

    An id that does not look like one of the recruiter's counts as none, and so does a `turkSubmitTo` that does not name
    MTurk.
    """
    value = _parameter(given, recruitment.person_parameter)
    person = recruitment.person_of(value) if value is not None else None
    found = {name: _parameter(given, name) for name in recruitment.extra_parameters}
    extra = {name: value for name, value in found.items() if value and value != PREVIEW}
    if MTURK_HOME in extra:
        origin = mturk_origin(extra.pop(MTURK_HOME))
        if origin is not None:
            extra[MTURK_HOME] = origin
        else:
            log.warning("a link with a turkSubmitTo that is not an address of MTurk was opened: the value is ignored")
    return person, extra


def link_parameters(recruitment: Recruitment, person: str | None, extra: Mapping[str, str]) -> dict[str, str]:
    """Return the parameters of the link that `recruitment_of` has read: a form carries them to the next page."""
    named = {recruitment.person_parameter: person} if recruitment.person_parameter and person is not None else {}
    return dict(extra) | named


def is_preview(recruitment: Recruitment, given: Mapping[str, str]) -> bool:
    """Return whether this is a preview of an MTurk assignment that the person has not accepted."""
    return recruitment.source == "mturk" and _parameter(given, "assignmentId") == PREVIEW


def may_start_new(study: Study) -> bool:
    """Return whether a second person in the same browser may begin without a personal link."""
    return study.recruitment.person_parameter is None


def leave_url(outcome: Exit, values: Mapping[str, str]) -> str | None:
    """Return the study's own address for this outcome, filled in; None where there is none or a value for it is
    missing."""
    if outcome.url is None:
        return None
    url = outcome.url
    for name, value in values.items():
        url = url.replace(f"{{{name}}}", quote(value, safe=""))
    return None if "{" in url else url


def return_target(recruitment: Recruitment, outcome: Exit, values: Mapping[str, str]) -> ReturnTarget | None:
    """Return the way back to the recruiter, which reports a finished assignment. `values`: `code`, `person` and the
    link's parameters."""
    url = leave_url(outcome, values)
    if url is not None:
        return ReturnTarget(url)
    assignment, home = values.get("assignmentId", PREVIEW), mturk_origin(values.get(MTURK_HOME, ""))
    if recruitment.source != "mturk" or outcome is not recruitment.completed or assignment == PREVIEW:
        return None
    if home is None:
        return None
    fields = {"assignmentId": assignment, "code": values.get("code", "")}
    return ReturnTarget(f"{home}/mturk/externalSubmit", fields)


def turned_away(
    recruitment: Recruitment, outcome: Exit, person: str | None, extra: Mapping[str, str]
) -> dict[str, Any]:
    """Return the code and the way back of somebody who does not get in, and of whom nothing is stored."""
    values = dict(extra) | {name: value for name, value in (("person", person), ("code", outcome.code)) if value}
    return {"code": outcome.code, "back": return_target(recruitment, outcome, values)}


def mturk_origin(address: str) -> str | None:
    """Return the one of MTURK_ORIGINS that the address names as a whole, or None."""
    wanted = address.lower().removesuffix("/")
    return next((origin for origin in MTURK_ORIGINS if origin == wanted), None)


def _parameter(given: Mapping[str, str], name: str | None) -> str | None:
    """Return a parameter's value, whatever the case of its name; one that is too long, not printable or a placeholder
    that the recruiter did not fill in counts as none."""
    value = _value(given, name).strip() if name else ""
    if not value or len(value) > MAX_PARAMETER_LENGTH or not value.isprintable():
        return None
    return None if _PLACEHOLDER.search(value) or _PLACEHOLDER.search(unquote(value)) else value


def _value(given: Mapping[str, str], name: str) -> str:
    if name in given:
        return given[name]
    return next((value for key, value in given.items() if key.casefold() == name.casefold()), "")
