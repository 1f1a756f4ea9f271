"""Protection against invented participants: places per address, places that are held briefly, and an alert."""

import asyncio
from collections.abc import Iterator
from dataclasses import replace
from datetime import UTC, datetime, timedelta
from pathlib import Path

import httpx
import pytest
from sqlalchemy import Connection, select

from server.monitoring import invented_participants
from server.participation import places
from server.store import enrolment_limits, participants
from server.store.database import Database
from server.store.enrolment_limits import EnrolmentLimitReached
from server.store.tables import attempts
from server.store.tables import participants as table
from server.web.client_address import address_of
from server.web.rate_limits import EnrolmentLimits
from tests.support.page_site import EVERYTHING, SMALL_STUDY, PageSite, Visitor

ONE_EACH = SMALL_STUDY.replace("predictor: none}", "predictor: none, quota: 1}").replace(
    "predictor: tom}", "predictor: tom, quota: 1}"
)

SECRET = b"a secret of this test"


@pytest.fixture
def site(tmp_path: Path) -> Iterator[PageSite]:
    with PageSite(tmp_path, ONE_EACH, SMALL_STUDY.replace("name: small", "name: wide", 1)) as running:
        yield running


def consented_ago(site: PageSite, minutes: float) -> None:
    at = datetime.now(UTC) - timedelta(minutes=minutes)
    values = {"started_at": at, "last_seen_at": datetime.now(UTC)}  # a client that keeps asking for its page
    site.database.write_now(lambda connection: connection.execute(table.update().values(values)))


def limit(site: PageSite, an_hour: int) -> None:
    web = replace(site.services.web, enrolment_limits=EnrolmentLimits(an_hour, SECRET, counts_local=True))
    site.use(replace(site.services, web=web))


def test_one_address_brings_so_many_new_people_and_no_more(site: PageSite) -> None:
    limit(site, 3)
    statuses = [Visitor(site).consent("wide").status_code for _ in range(5)]
    assert statuses == [200, 200, 200, 429, 429]
    assert len(site.everybody("wide")) == 3
    page = Visitor(site).consent("wide")
    assert "Too many people have started here" in page.text
    assert page.headers["retry-after"]


def test_an_existing_participant_needs_no_new_place(site: PageSite) -> None:
    limit(site, 2)
    known = Visitor(site)
    known.get("/s/wide")
    fields = known.fields("/consent") | {"box_0": "yes"}
    for _ in range(5):
        assert Visitor(site).send("/s/wide/consent", fields).status_code == 200
    assert known.send("/s/wide/consent", fields).status_code == 200
    assert Visitor(site).consent("wide").status_code == 200, "five copies of one page took one place"
    assert Visitor(site).consent("wide").status_code == 429
    assert known.get("/s/wide/now").status_code == 200


def test_a_place_that_came_to_nothing_is_given_back(site: PageSite) -> None:
    limit(site, 3)
    for _ in range(2):
        Visitor(site).consent("small")
    for _ in range(4):
        assert Visitor(site).consent("small").status_code == 409, "full"
    assert Visitor(site).consent("wide").status_code == 200
    assert Visitor(site).consent("wide").status_code == 429


def brought(database: Database, configured: EnrolmentLimits, address: str, at: datetime) -> bool:
    """Whether the address may bring somebody new at this moment; they are enrolled if so."""
    limits = configured.limits_of(address)

    def enrol(connection: Connection) -> None:
        enrolment_limits.check(connection, limits, at)
        enrolment_limits.take(connection, limits, at)

    try:
        database.write_now(enrol)
    except EnrolmentLimitReached:
        return False
    return True


def test_a_place_comes_back_with_time_and_not_before(site: PageSite) -> None:
    configured, database, now = EnrolmentLimits(6, SECRET), site.database, datetime.now(UTC)
    assert [brought(database, configured, "192.0.2.1", now) for _ in range(7)] == [True] * 6 + [False]
    assert brought(database, configured, "192.0.2.2", now), "another address"
    assert not brought(database, configured, "192.0.2.1", now + timedelta(minutes=59))
    assert brought(database, configured, "192.0.2.1", now + timedelta(minutes=61))


def test_the_networks_of_one_ipv6_site_share_a_limit_and_neighbours_have_their_own(site: PageSite) -> None:
    configured, database, now = EnrolmentLimits(2, SECRET), site.database, datetime.now(UTC)
    let_in = [brought(database, configured, f"2001:db8:1:{n:x}::/64", now) for n in range(40)]
    assert let_in == [True] * 8 + [False] * 32
    assert brought(database, configured, "2001:db8:2:1::/64", now)


def test_addresses_are_stored_as_keyed_hashes_only(site: PageSite) -> None:
    brought(site.database, EnrolmentLimits(2, SECRET), "192.0.2.7", datetime.now(UTC))
    (row,) = site.database.read_now(lambda connection: connection.execute(select(attempts)).mappings().all())
    assert "192.0.2.7" not in str(dict(row))
    assert row["name"] != EnrolmentLimits(2, b"another secret").limits_of("192.0.2.7")[0].network


def test_refused_participants_are_counted_for_an_hour_and_up_to_a_limit(
    site: PageSite, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(enrolment_limits, "MAX_TURNED_AWAY", 3)
    now = datetime.now(UTC)
    for _ in range(5):
        site.database.write_now(enrolment_limits.turn_away, "wide", now)
    assert site.database.read_now(enrolment_limits.turned_away, "wide", now) == 3
    assert site.database.read_now(enrolment_limits.turned_away, "small", now) == 0
    assert site.database.read_now(enrolment_limits.turned_away, "wide", now + timedelta(minutes=61)) == 0


@pytest.mark.parametrize(("an_hour", "counts_local"), [(0, True), (1, False)])
def test_no_limit_and_the_own_machine(an_hour: int, counts_local: bool) -> None:
    assert EnrolmentLimits(an_hour, SECRET, counts_local).limits_of("127.0.0.1") == []


@pytest.mark.parametrize(
    ("host", "address"),
    [
        ("192.0.2.1", "192.0.2.1"),
        ("2001:db8:1:2:3:4:5:6", "2001:db8:1:2::/64"),
        ("2001:db8:1:2:ffff::9", "2001:db8:1:2::/64"),
        ("::ffff:192.0.2.1", "192.0.2.1"),
        ("::1", "::1"),
        ("fe80::1%eth0", "fe80::/64"),
        ("testclient", "testclient"),
    ],
)
def test_a_household_of_ipv6_is_one_address(host: str, address: str) -> None:
    class Asking:
        client = type("Address", (), {"host": host})

    assert address_of(Asking()) == address  # type: ignore[arg-type]


def test_a_place_is_held_briefly_until_something_is_done(site: PageSite) -> None:
    silent = Visitor(site)
    for _ in range(2):
        silent = Visitor(site)
        silent.consent("small")
    assert Visitor(site).consent("small").status_code == 409
    consented_ago(site, 9)
    assert Visitor(site).consent("small").status_code == 409
    consented_ago(site, 11)
    real = [Visitor(site), Visitor(site)]
    for person in real:
        assert person.consent("small").status_code == 200
        person.submit("small", **EVERYTHING)
    assert Visitor(site).consent("small").status_code == 409
    answer = silent.get("/s/small/now")
    assert "your place was given to another participant" in answer.text
    statuses = [one.status for one in site.everybody("small")]
    assert sorted(statuses) == ["active", "active", "active", "timed_out"], "the other has not asked yet"
    assert [one.position for one in site.everybody("small") if one.position] == [1, 1]


def test_a_late_first_page_is_accepted_if_there_is_room(site: PageSite) -> None:
    late = Visitor(site)
    late.consent("small")
    consented_ago(site, 60)
    late.submit("small", **EVERYTHING)
    assert (site.only("small").status, site.only("small").position) == ("active", 1)


def test_a_late_first_page_ends_the_study_if_there_is_no_room(site: PageSite) -> None:
    late = Visitor(site)
    late.consent("small")
    Visitor(site).consent("small")
    consented_ago(site, 60)
    for _ in range(2):
        Visitor(site).consent("small")
    late.submit("small", **EVERYTHING)
    assert "your place was given to another participant" in late.page.text
    assert site.everybody("small")[0].status == "timed_out"


def test_an_active_participant_keeps_the_place_for_as_long_as_the_study_says(site: PageSite) -> None:
    for _ in range(2):
        person = Visitor(site)
        person.consent("small")
        person.submit("small", **EVERYTHING)
    consented_ago(site, 100)
    assert Visitor(site).consent("small").status_code == 409
    assert {one.status for one in site.everybody("small")} == {"active"}


def test_a_game_that_has_begun_is_a_sign_of_life(site: PageSite) -> None:
    visitor = Visitor(site)
    visitor.consent("small")
    me = site.only("small")
    assert site.database.read_now(participants.is_silent, me.id)
    index = [step.key for step in site.studies.steps_of(me)].index("tutorial")
    site.database.write_now(participants.advance, me.id, 0, index)
    site.end_game(me)
    episode = "update episodes set started_at = created_at"
    site.database.write_now(lambda connection: connection.exec_driver_sql(episode))
    back = "update participants set position = 0"
    site.database.write_now(lambda connection: connection.exec_driver_sql(back))
    assert not site.database.read_now(participants.is_silent, me.id)
    (number, _) = site.studies.open("small") or (0, None)
    later = datetime.now(UTC) + timedelta(hours=1)
    assert site.database.read_now(participants.silent, (number,), later) == {}


def signs(site: PageSite, name: str, leads: bool = True) -> dict[str, str]:
    return asyncio.run(invented_participants.signs(site.services.web, name, site.studies.versions(name), leads))


def test_researchers_get_an_alert_for_people_who_consent_and_do_nothing(site: PageSite) -> None:
    for _ in range(invented_participants.FEWEST):
        Visitor(site).consent("wide")
    assert signs(site, "wide") == {}, "they may still begin"
    consented_ago(site, 15)
    (text,) = signs(site, "wide").values()
    assert "5 of 5 people who consented" in text
    assert signs(site, "wide", leads=False) == {}
    assert signs(site, "small") == {}
    consented_ago(site, 90)
    assert signs(site, "wide") == {}, "long ago"


def test_researchers_get_an_alert_for_an_address_that_takes_too_many_places(site: PageSite) -> None:
    limit(site, 1)
    for _ in range(3):
        Visitor(site).consent("wide")
    (text,) = signs(site, "wide").values()
    assert signs(site, "wide", leads=False) == {}, "one process tells it"
    assert "2 were refused" in text
    assert "KITCHENMIND_NEW_PER_ADDRESS" in text
    assert "127.0.0.1" not in text


def test_assignment_counts_participants_who_hold_a_place(site: PageSite) -> None:
    for _ in range(2):
        Visitor(site).consent("small")
    consented_ago(site, 11)
    (number, study) = site.studies.open("small") or (0, None)
    assert study is not None
    assert [count.held for count in site.database.read_now(places.held, (number,), study).values()] == [0, 0]


def test_twenty_at_once_get_the_places_that_there_are(site: PageSite) -> None:
    limit(site, 4)
    forms = []
    for _ in range(20):
        visitor = Visitor(site)
        visitor.get("/s/wide")
        forms.append(visitor.fields("/consent") | {"box_0": "yes"})

    async def send_all() -> list[int]:
        async with httpx.AsyncClient(base_url=site.url, headers={"accept": "text/html"}, timeout=60) as client:
            answers = await asyncio.gather(*(client.post("/s/wide/consent", data=form) for form in forms))
        return sorted(answer.status_code for answer in answers)

    assert asyncio.run(send_all()) == [303] * 4 + [429] * 16
    assert len(site.everybody("wide")) == 4
