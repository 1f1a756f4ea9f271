"""The levels of a study's factors, as columns of the table of participants."""

from server.export.codebook import FACTOR
from server.export.codebook_columns import Column
from server.store.studies import StudyVersion
from server.study.factors import crossed, levels_of
from server.study.loader import StudyError, values_of

Levels = dict[str, dict[str, dict[str, str]]]  # version of a study as "key 1" -> condition -> column -> level


def factor_levels(versions: list[StudyVersion]) -> Levels:
    """Return the levels of each condition, for the versions that have factors."""
    found: Levels = {}
    for version in versions:
        try:
            factors = levels_of(values_of(version.source).get("factors"))
        except StudyError:  # written for another version of the software
            continue
        if factors:
            found[version_key(version.key, version.version)] = {
                condition: {FACTOR.name.format(factor=factor): level for factor, level in levels.items()}
                for condition, levels in crossed(factors)
            }
    return found


def version_key(key: str, version: int) -> str:
    return f"{key} {version}"


def factor_columns(levels: Levels) -> tuple[Column, ...]:
    """Return a column for each factor, in the order of the study files."""
    rows = (row for conditions in levels.values() for row in conditions.values())
    names = dict.fromkeys(name for row in rows for name in row)
    return tuple(Column(name, FACTOR.type, FACTOR.meaning) for name in names)
