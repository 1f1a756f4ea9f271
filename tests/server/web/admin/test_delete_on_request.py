"""A researcher deletes somebody who asks for it: found by code or id, and the audit log does not name the person."""

import pytest
from sqlalchemy import text as sql

from server.participation.game_seats import ConnectedPlayer
from server.play.close_codes import CloseCode
from server.store import audit, participants, tombstones
from server.store.tables import RECRUITMENT_ID, metadata
from tests.support.page_site import PageSite
from tests.support.researcher_site import played, signed_in


def everything(site: PageSite) -> str:
    def read(connection) -> list[str]:  # type: ignore[no-untyped-def]
        return [str(connection.execute(sql(f"select * from {table.name}")).all()) for table in metadata.sorted_tables]

    return "\n".join(site.database.read_now(read))


@pytest.mark.parametrize("role", ["act", "own"])
def test_a_researcher_with_the_role_act_deletes_a_participant_on_request(site: PageSite, role: str) -> None:
    episode = played(site)
    person = site.only("small").id
    researcher = signed_in(site, role)
    page = researcher.get(f"/admin/s/small/person/{person}")
    assert "Delete on request" in page.text
    answer = researcher.post(f"/admin/s/small/person/{person}/delete", note="asked by mail", next="/admin")
    assert answer.url.path == "/admin/s/small"
    assert "The participant is deleted. The audit log records it" in answer.text
    stored = everything(site)
    assert person not in stored
    assert episode not in stored
    entries = site.database.read_now(audit.entries)
    assert [(one.actor, one.action) for one in entries][-1] == (role, "delete participant")
    assert (entries[-1].detail or {})["reason"] == "asked by mail"
    assert site.database.read_now(audit.first_forged) is None
    assert site.database.read_now(tombstones.every)[0].is_of(person)
    assert researcher.get(f"/admin/s/small/person/{person}").status_code == 404


class OpenSocket:
    """A socket of a page in the waiting room."""

    def __init__(self, participant: str) -> None:
        self.player = ConnectedPlayer(participant, None, -1, "/s/small/now")
        self.closed: int | None = None

    def close(self, code: int, reason: str) -> None:
        self.closed = code


def test_the_open_pages_of_a_deleted_participant_are_told(site: PageSite) -> None:
    played(site)
    person = site.only("small").id
    here, other = OpenSocket(person), OpenSocket("another")
    site.services.sockets._open |= {here: None, other: None}  # type: ignore[dict-item]
    researcher = signed_in(site, "own")
    researcher.get(f"/admin/s/small/person/{person}")
    researcher.post(f"/admin/s/small/person/{person}/delete", note="asked by mail", next="/admin")
    assert (here.closed, other.closed) == (CloseCode.NO_GAME, None)
    site.services.sockets._open.clear()


def test_a_researcher_with_the_role_watch_can_neither_find_nor_delete_participants(site: PageSite) -> None:
    played(site)
    person = site.only("small").id
    researcher = signed_in(site, "watch")
    assert "Delete on request" not in researcher.get(f"/admin/s/small/person/{person}").text
    token = researcher.token()
    assert researcher.post(f"/admin/s/small/person/{person}/delete", token, note="x").status_code == 403
    assert researcher.post("/admin/s/small/find", token, who=person).status_code == 403
    assert "Find the participant" not in researcher.get("/admin/s/small").text
    assert site.only("small").id == person


def test_a_deletion_needs_a_reason(site: PageSite) -> None:
    played(site)
    person = site.only("small").id
    researcher = signed_in(site, "own")
    researcher.get(f"/admin/s/small/person/{person}")
    assert researcher.post(f"/admin/s/small/person/{person}/delete", note="  ").status_code == 400
    assert site.only("small").id == person


def test_somebody_is_found_by_code_by_the_recruiter_s_id_and_by_id(site: PageSite) -> None:
    played(site)
    me = site.only("small")
    site.database.write_now(participants.add_personal, me.id, me.study_id, RECRUITMENT_ID, "5f1e")
    site.database.write_now(participants.complete, me.id, "KM-7777-8888")
    researcher = signed_in(site, "act")
    for word in ("km-7777-8888", " KM-7777-8888 ", "5F1E", me.id):
        researcher.get("/admin/s/small")
        assert "Find the participant" in researcher.page.text
        assert researcher.post("/admin/s/small/find", who=word).url.path == f"/admin/s/small/person/{me.id}"
    for word in ("KM-0000-0000", "", "%", me.id[:-1]):
        researcher.get("/admin/s/small")
        answer = researcher.post("/admin/s/small/find", who=word)
        assert "There is no participant with this id or code" in answer.text
    noted = str([one.detail for one in site.database.read_now(audit.entries) if one.action == "find participant"])
    assert "5F1E" not in noted
    assert me.id not in noted
