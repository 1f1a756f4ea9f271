"""Check that the recruitment of a study file fits the study, and that all people get a code and a way back. Pure:
yields problems."""

# Python's parser of patterns has no public name; one of our own could read patterns differently from `re`.
import re._parser as _parser  # type: ignore[import-not-found]
from collections.abc import Iterator
from typing import Final

from server.study.checks import Path, Problem
from server.study.definition import Study
from server.study.quick_fixes import write
from server.study.steps import has_rounds_for_two

MAX_REPEATS: Final = 20  # of a part of an id that are harmless within another repetition
_REPEATS: Final = (_parser.MAX_REPEAT, _parser.MIN_REPEAT)


def recruitment_problems(study: Study) -> Iterator[Problem]:
    """Yield everything wrong with the recruitment of a study whose single values are valid."""
    recruitment = study.recruitment
    if recruitment.source != "none" and not recruitment.required:
        reason = "who opens the link without an id takes a place, cannot be paid, and can take part again"
        fix = write("Refuse such links", ("recruitment", "required"), True)
        yield Problem(("recruitment", "required"), reason, "Set `required: true`.", warning=True, fix=fix)
    if recruitment.required and recruitment.person_parameter is None:
        yield Problem(("recruitment", "required"), "no parameter has the person's id", "Set `person:` or a `source`.")
    if can_be_slow(recruitment.person_pattern or ""):
        reason = "a repetition within a repetition, such as (a+)+, can stop the server for hours at one wrong id"
        remedy = "Repeat only one of the two, or say how often: [a-z]{1,20}."
        yield Problem(("recruitment", "person_pattern"), reason, remedy, warning=True)
    known = {"code", "person", *recruitment.extra_parameters}
    for name in ("completed", "screened_out", "unpaired", "declined"):
        outcome = getattr(recruitment, name)
        for placeholder in _placeholders(outcome.url or ""):
            if placeholder not in known:
                reason = f"the address has an unknown placeholder {{{placeholder}}}"
                yield Problem(("recruitment", name, "url"), reason, f"Known: {', '.join(sorted(known))}.")
    if recruitment.source == "prolific" and not recruitment.completed.code:
        yield Problem(
            ("recruitment", "completed"),
            "Prolific needs a fixed code",
            "Add `code:` as shown by Prolific.",
            warning=True,
        )
    if recruitment.source == "prolific" and not recruitment.screened_out.code and _screens_out(study):
        reason = "people who are screened out get no code, and cannot end their submission at Prolific"
        remedy = "Add `code:` as shown by Prolific."
        yield Problem(("recruitment", "screened_out"), reason, remedy, warning=True)
    partner_may_not_come = has_rounds_for_two(study) and study.waiting_room.fallback == "leave"
    if recruitment.source == "prolific" and not recruitment.unpaired.code and partner_may_not_come:
        reason = "people whose partner does not arrive get a code that Prolific does not know"
        remedy = "Add `code:` as shown by Prolific."
        yield Problem(("recruitment", "unpaired"), reason, remedy, warning=True)
    yield from _odd_quotas(study)


def can_be_slow(pattern: str) -> bool:
    """Return whether a regular expression repeats something that is itself repeated. The time for an id that does not
    fit can then double with each of its letters, and Python's `re` cannot be interrupted."""
    return _repeats(_parser.parse(pattern), within=False)


def _repeats(parts: object, within: bool) -> bool:
    """Return whether a part of a parsed expression is repeated. `within`: all of it is repeated already."""
    if isinstance(parts, tuple) and len(parts) == 2 and parts[0] in _REPEATS:
        _, highest, inner = parts[1]
        is_many = highest > MAX_REPEATS
        return (within and is_many) or _repeats(inner, within or is_many)
    if isinstance(parts, tuple | list | _parser.SubPattern):
        return any(_repeats(part, within) for part in parts)
    return False


def _odd_quotas(study: Study) -> Iterator[Problem]:
    """Yield a warning about each quota of a study for two with which the last person of a condition finds no
    partner."""
    if not has_rounds_for_two(study):
        return
    quotas: list[tuple[Path, int | None]] = [
        (("conditions", index, "quota"), condition.quota) for index, condition in enumerate(study.conditions)
    ]
    for path, quota in [(("cells", "quota"), study.cells.quota)] if study.factors else quotas:
        if quota is not None and quota % 2:
            each = " in each condition" if study.factors else ""
            reason = f"of {quota} people{each}, one finds no partner"
            fix = write(f"Make it {quota + 1}", path, quota + 1)
            yield Problem(path, reason, f"Write {quota + 1}.", warning=True, fix=fix)


def _screens_out(study: Study) -> bool:
    """Return whether the study sends people away after they have worked for it."""
    by_quiz = study.quiz is not None and study.quiz.attempts is not None
    return by_quiz or study.attention.screen_out_after is not None


def _placeholders(url: str) -> list[str]:
    return [piece.split("}", 1)[0] for piece in url.split("{")[1:] if "}" in piece]
