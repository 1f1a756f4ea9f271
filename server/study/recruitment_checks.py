"""Check that the recruitment of a study file fits the study, and that all people get a code and a way back. Pure:
yields problems."""

from collections.abc import Iterator

from server.study.checks import Path, Problem
from server.study.definition import Study
from server.study.quick_fixes import write
from server.study.steps import has_rounds_for_two


def recruitment_problems(study: Study) -> Iterator[Problem]:
    """Yield everything wrong with the recruitment of a study whose single values are valid."""
    recruitment = study.recruitment
    if recruitment.source != "none" and not recruitment.required:
        reason = "who opens the link without an id takes a place, cannot be paid, and can take part again"
        fix = write("Refuse such links", ("recruitment", "required"), True)
        yield Problem(("recruitment", "required"), reason, "Set `required: true`.", warning=True, fix=fix)
    if recruitment.required and recruitment.person_parameter is None:
        yield Problem(("recruitment", "required"), "no parameter has the person's id", "Set `person:` or a `source`.")
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
