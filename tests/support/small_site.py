"""A site with a small study, as it is and as a recruiter's, and a participant who walks it page by page."""

from collections.abc import Iterator
from pathlib import Path

import pytest
from sqlalchemy import text as sql

from server.store.tables import metadata
from tests.support.page_site import EVERYTHING, SMALL_STUDY, PageSite, Visitor

PROLIFIC = SMALL_STUDY.replace("name: small", "name: hired", 1).replace(
    "seed: 11\n",
    "seed: 11\nrecruitment:\n  source: prolific\n  required: true\n"
    '  completed: {code: C1ABC, url: "https://app.prolific.com/submissions/complete?cc={code}"}\n'
    '  screened_out: {code: C2DEF, url: "https://app.prolific.com/submissions/complete?cc={code}"}\n',
)


LINK = "?PROLIFIC_PID=5f1e00000000000000000001&STUDY_ID=s1&SESSION_ID=x9"


@pytest.fixture
def site(tmp_path: Path) -> Iterator[PageSite]:
    with PageSite(tmp_path, SMALL_STUDY, PROLIFIC) as running:
        yield running


def rows(site: PageSite) -> dict[str, int]:
    def count(connection):  # type: ignore[no-untyped-def]
        return {
            table.name: connection.execute(sql(f"select count(*) from {table.name}")).scalar()
            for table in metadata.sorted_tables
        }

    return site.database.read_now(count)


def walk_to(visitor: Visitor, site: PageSite, key: str, name: str = "small") -> None:
    """From consent to the step with this key, playing the games by hand."""
    visitor.consent(name)
    while (step := site.step(site.only(name))).key != key:
        pass_step(visitor, site, step.kind, name)


def pass_step(visitor: Visitor, site: PageSite, kind: str, name: str = "small") -> None:
    participant = site.only(name)
    if kind in ("tutorial", "episode"):
        site.end_game(participant)
        visitor.get(f"/s/{name}/now")
        return
    step = site.step(participant)
    given = {"quiz": {"onions": "three"}, "everything": EVERYTHING, "after": {"partner": "5", "marks": "6"}}
    visitor.submit(name, **given.get(step.page or step.kind, {}))
