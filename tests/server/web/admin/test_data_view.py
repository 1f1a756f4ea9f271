"""The data view over real HTTP: filter, order and pages of three tables, what blind mode hides, the download."""

import csv
import html
import io
import re
from dataclasses import replace
from typing import Any

import pytest

from server.store import answers, audit
from server.store.answers import SubmittedPage
from server.store.data_view import PAGE_ROWS, TABLES, DataPage, DataQuery, data_page
from server.store.database import Database
from server.web.admin import data_pages
from tests.support.page_site import PageSite, Visitor
from tests.support.researcher_site import Researcher, signed_in
from tests.support.researcher_site import site as admin_site

site = admin_site


@pytest.fixture
def researcher(site: PageSite) -> Researcher:
    site.app.include_router(data_pages.router)
    site.use(replace(site.services, games=site.services.live.games))
    for number in range(3):
        Visitor(site).consent("small", f"?PROLIFIC_PID=person{number}")
    return signed_in(site, "act")


def cells(researcher: Researcher, query: str = "") -> list[list[str]]:
    """The table that the page shows, with its head."""
    text = researcher.get(f"/admin/s/small/data{query}").text
    assert researcher.page.status_code == 200, text
    table = text[text.index('id="data"') : text.index("</table>")]
    rows = re.findall(r"<tr>(.*?)</tr>", table, re.S)
    return [[_plain(cell) for cell in re.findall(r"<t[hd][^>]*>(.*?)</t[hd]>", row, re.S)] for row in rows]


def _plain(cell: str) -> str:
    return html.unescape(re.sub(r"<[^>]*>", "", cell)).strip()


def unblind(researcher: Researcher) -> None:
    researcher.get("/admin/s/small/data")
    researcher.post("/admin/blind", blind="off", next="/admin/s/small/data")


def answer(site: PageSite, **values: object) -> None:
    person = site.everybody("small")[0]
    site.database.write_now(answers.save, SubmittedPage(person.id, "page", dict(values), None, 12.0))


def test_blind_mode_hides_conditions_and_refuses_the_download(researcher: Researcher) -> None:
    head, *rows = cells(researcher)
    assert "Condition" not in head
    assert len(rows) == 3
    assert "condition" not in cells(researcher, "?table=episodes")[0]
    assert "Shown" not in cells(researcher, "?table=episodes")[0]
    assert researcher.get("/admin/s/small/data?sort=condition&column=condition&contains=tom").status_code == 200
    assert "▲" not in researcher.page.text
    assert researcher.post("/admin/s/small/data.csv", table="participants").status_code == 409
    unblind(researcher)
    assert "Condition" in cells(researcher)[0]


def test_rows_are_filtered_and_sorted_by_the_database(researcher: Researcher, site: PageSite) -> None:
    head, *rows = cells(researcher, "?sort=-participant")
    assert [row[0] for row in rows] == ["P-003", "P-002", "P-001"]
    assert [row[head.index("Status")] for row in cells(researcher, "?contains=CTIVE&column=status")[1:]] == [
        "active"
    ] * 3
    assert cells(researcher, "?contains=%25&column=status")[1:] == [["Nothing matches the filter."]]
    answer(site, words="茶 =1+1", many=["a", "c"])
    shown = cells(researcher, "?table=answers&contains=%E8%8C%B6&column=value")[1:]
    assert [row[-4] for row in shown] == ["茶 =1+1"]
    assert "person0" not in researcher.get("/admin/s/small/data?table=answers").text


def test_the_download_has_what_is_seen_with_formulas_made_harmless(researcher: Researcher, site: PageSite) -> None:
    answer(site, words="=HYPERLINK(1)", mood=-4)
    unblind(researcher)
    researcher.get("/admin/s/small/data?table=answers")
    sent = researcher.post("/admin/s/small/data.csv", table="answers", contains="words", column="question")
    assert sent.headers["content-disposition"] == 'attachment; filename="small-answers.csv"'
    (row,) = csv.DictReader(io.StringIO(sent.content.decode("utf-8-sig")))
    assert (row["question"], row["value"], row["participant"]) == ("words", "'=HYPERLINK(1)", "P-001")
    researcher.get("/admin/s/small/data?table=answers")
    sent = researcher.post("/admin/s/small/data.csv", table="answers", contains="mood", column="question")
    assert next(csv.DictReader(io.StringIO(sent.content.decode("utf-8-sig"))))["value"] == "-4"
    (entry,) = [one for one in site.database.read_now(audit.entries) if one.action == "download table"][:1]
    assert entry.detail == {"study": "small", "table": "answers", "filtered": True}
    log = researcher.get("/admin/audit").text
    assert '<span class="soft">filtered</span> yes</span>' in log


def test_a_download_is_of_one_moment_although_people_take_part(
    researcher: Researcher, site: PageSite, monkeypatch: pytest.MonkeyPatch
) -> None:
    first, second, _ = sorted(site.everybody("small"), key=lambda person: person.number)
    for person in (first, second):
        page = SubmittedPage(person.id, "page", {"words": "a", "mood": 1, "many": 2}, None, 12.0)
        site.database.write_now(answers.save, page)
    unblind(researcher)
    researcher.get("/admin/s/small/data?table=answers")
    monkeypatch.setattr(data_pages, "CHUNK_ROWS", 2)

    def then_somebody_answers(connection: Any, wanted: DataQuery, done: int, most: int) -> DataPage:
        found = data_page(connection, wanted, done, most)
        late = SubmittedPage(first.id, f"page-{done}", {f"late-{done}": 1}, None, 12.0)
        site.database.write_now(answers.save, late)
        return found

    monkeypatch.setattr(data_pages, "data_page", then_somebody_answers)
    sent = researcher.post("/admin/s/small/data.csv", table="answers")
    rows = list(csv.DictReader(io.StringIO(sent.content.decode("utf-8-sig"))))
    asked = ["words", "mood", "many"]
    assert sorted(row["question"] for row in rows if row["participant"] == "P-001") == sorted(asked)
    assert sorted(row["question"] for row in rows if row["participant"] == "P-002") == sorted(asked)


def test_unknown_tables_and_other_roles_are_refused(researcher: Researcher, site: PageSite) -> None:
    assert researcher.get("/admin/s/small/data?table=admins").status_code == 404
    assert researcher.get("/admin/s/small/data?page=99999&table=episodes").status_code == 200
    watcher = signed_in(site, "watch")
    assert watcher.get("/admin/s/small/data").status_code == 403


@pytest.mark.parametrize("table", TABLES)
@pytest.mark.parametrize("blind", [True, False])
def test_every_column_can_be_filtered_and_sorted_in_both_databases(filled: Database, table: str, blind: bool) -> None:
    plain = DataQuery(table, (1,), blind=blind)
    everything = filled.read_now(data_page, plain, 0, 1000)
    assert everything.total == len(everything.rows) > 0
    for column in everything.columns:
        for sort in (column.name, f"-{column.name}"):
            wanted = DataQuery(table, (1,), sort=sort, column=column.name, contains="a", blind=blind)
            found = filled.read_now(data_page, wanted, 0)
            assert found.total <= everything.total
            assert len(found.rows) == min(found.total, PAGE_ROWS)
        pages = [
            filled.read_now(data_page, DataQuery(table, (1,), sort=column.name, blind=blind), at, 3) for at in (0, 3)
        ]
        assert not {tuple(map(str, row)) for row in pages[0].rows} & {tuple(map(str, row)) for row in pages[1].rows}
