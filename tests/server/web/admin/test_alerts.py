"""Alerts of a running study: their beginning, their text, their end."""

import asyncio
import copy
import time
from datetime import UTC, datetime, timedelta
from functools import partial
from pathlib import Path

import pytest

from server.monitoring import invented_participants
from server.monitoring.alerts import Alert, Alerts, message_of
from server.monitoring.peers import Process, SingleProcess
from server.play.lateness import LATELY_S, Lateness
from server.store import events
from server.store.database import DatabaseDown
from server.store.tables import events as events_table
from server.store.tables import participants as participants_table
from tests.support.page_site import PageSite, Visitor


def test_alerts_are_posted_when_they_begin_and_when_they_are_over(site: PageSite, tmp_path: Path) -> None:
    told: list[tuple[str, bool]] = []
    alerts = Alerts(site.services.live, tmp_path / "site.db", lambda alert, over: told.append((alert.key, over)))
    asyncio.run(alerts.check())
    assert told == []
    loop = site.services.live.games.loop
    for late_ms in [3.0] * 50 + [90.0]:
        loop.lateness.add(late_ms)
    Visitor(site).consent("small")
    person = site.only("small").id
    site.database.write_now(events.add, events.Event("trouble", datetime.now(UTC), person, detail={"text": "a secret"}))
    asyncio.run(alerts.check())
    asyncio.run(alerts.check())
    assert sorted(told) == [("late", False), (f"trouble {person}", False)], "each once"
    assert not any("secret" in alert.text for alert in alerts.open.values())
    assert str(alerts.shown("small")[0]["text"]).startswith("Timesteps come late: 90 ms")
    loop.lateness = Lateness()
    asyncio.run(alerts.check())
    assert told[-1] == ("late", True)


def test_the_errors_of_one_browser_do_not_hide_those_of_another(site: PageSite, tmp_path: Path) -> None:
    alerts = Alerts(site.services.live, tmp_path / "site.db", lambda *_: None)
    for _ in range(2):
        Visitor(site).consent("small")
    people = [one.id for one in site.everybody("small")]
    now = datetime.now(UTC)
    for person in (people[0], *[people[1]] * 30):
        site.database.write_now(events.add, events.Event("trouble", now, person, detail={"text": "x"}))
    asyncio.run(alerts.check())
    assert sorted(alerts.open) == sorted(f"trouble {person}" for person in people)


def test_an_alert_of_a_study_is_not_over_because_the_database_cannot_be_read(
    site: PageSite, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    told: list[tuple[str, bool]] = []
    alerts = Alerts(site.services.live, tmp_path / "site.db", lambda alert, over: told.append((alert.key, over)))
    Visitor(site).consent("small")
    person = site.only("small").id
    site.database.write_now(events.add, events.Event("trouble", datetime.now(UTC), person, detail={"text": "x"}))
    asyncio.run(alerts.check())

    async def down(*_: object) -> None:
        raise DatabaseDown("away")

    with monkeypatch.context() as outage:
        outage.setattr(site.database, "read", down)
        asyncio.run(alerts.check())
    asyncio.run(alerts.check())
    assert told == [(f"trouble {person}", False), ("unreadable", False), ("unreadable", True)]


def test_an_alert_reports_people_who_consent_and_do_nothing(site: PageSite, tmp_path: Path) -> None:
    alerts = Alerts(site.services.live, tmp_path / "site.db", lambda *_: None)
    for _ in range(invented_participants.FEWEST):
        Visitor(site).consent("small")
    asyncio.run(alerts.check())
    assert alerts.open == {}
    earlier = {"started_at": datetime.now(UTC) - timedelta(minutes=15)}
    site.database.write_now(lambda connection: connection.execute(participants_table.update().values(earlier)))
    asyncio.run(alerts.check())
    assert list(alerts.open) == ["silent small"]
    assert "have done nothing since" in str(alerts.shown("small")[0]["text"])


def test_an_alert_has_the_newest_figure_and_ends_when_no_recent_tick_was_late(site: PageSite, tmp_path: Path) -> None:
    told: list[tuple[str, bool]] = []
    alerts = Alerts(site.services.live, tmp_path / "site.db", lambda alert, over: told.append((alert.key, over)))
    loop = site.services.live.games.loop
    loop.lateness.add(1274.0)
    asyncio.run(alerts.check())
    (first,) = alerts.open.values()
    loop.lateness = Lateness()
    loop.lateness.add(1274.0, time.monotonic() - LATELY_S - 1)  # long ago
    loop.lateness.add(61.0)
    asyncio.run(alerts.check())
    (second,) = alerts.open.values()
    assert ("1274 ms" in first.text, "61 ms" in second.text) == (True, True)
    assert second.since == first.since, "it is still the same alert"
    loop.lateness = Lateness()
    loop.lateness.add(1274.0, time.monotonic() - LATELY_S - 1)  # the last tick there was
    asyncio.run(alerts.check())
    assert alerts.open == {}
    assert told == [("late", False), ("late", True)]


def test_of_several_processes_one_posts_the_alerts_of_all(site: PageSite, tmp_path: Path) -> None:
    class Several(SingleProcess):
        other = ""

        async def processes(self) -> list[Process]:
            return [Process(self.other, {})]

    Visitor(site).consent("small")
    person = site.only("small").id
    site.database.write_now(events.add, events.Event("trouble", datetime.now(UTC), person, detail={"text": "x"}))
    site.services.live.peers = several = Several()
    for several.other, told in (("another", []), ("the last", [f"trouble {person}"])):
        alerts = Alerts(site.services.live, tmp_path / "site.db", lambda *_: None)
        asyncio.run(alerts.check())
        assert list(alerts.open) == told


class ProcessAndOthers(SingleProcess):
    """A process and the others that it sees."""

    def __init__(self, name: str) -> None:
        self.name = name
        self.others: list[tuple[str, Alerts]] = []

    async def processes(self) -> list[Process]:
        return [Process(name, {}, alerts.shared()) for name, alerts in self.others]


def test_an_alert_neither_ends_nor_begins_where_another_process_leads_from_now_on(
    site: PageSite, tmp_path: Path
) -> None:
    Visitor(site).consent("small")
    person = site.only("small").id
    site.database.write_now(events.add, events.Event("trouble", datetime.now(UTC), person, detail={"text": "x"}))
    told: list[tuple[str, str, bool]] = []
    processes: dict[str, tuple[ProcessAndOthers, Alerts]] = {}
    for name in ("a", "b"):
        live = copy.copy(site.services.live)
        live.peers = peers = ProcessAndOthers(name)
        tell = partial(lambda by, alert, over: told.append((by, alert.key, over)), name)
        processes[name] = (peers, Alerts(live, tmp_path / "site.db", tell))
    (first, alerts_of_first), (second, alerts_of_second) = processes.values()

    asyncio.run(alerts_of_second.check())  # alone
    first.others, second.others = [("b", alerts_of_second)], [("a", alerts_of_first)]
    for _ in range(2):  # the first one has just started, and leads
        asyncio.run(alerts_of_first.check())
        asyncio.run(alerts_of_second.check())
    assert list(alerts_of_first.open) == [f"trouble {person}"]
    assert list(alerts_of_second.open) == []
    second.others = []  # the first one was killed
    asyncio.run(alerts_of_second.check())
    assert told == [("b", f"trouble {person}", False)]
    site.database.write_now(lambda connection: connection.execute(events_table.delete()))
    asyncio.run(alerts_of_second.check())
    assert told[1:] == [("b", f"trouble {person}", True)]


def test_a_leader_that_has_just_started_has_not_seen_that_an_alert_is_over(site: PageSite, tmp_path: Path) -> None:
    """It looks at the study files some seconds later."""
    told: list[tuple[str, bool]] = []
    live = copy.copy(site.services.live)
    live.peers = peers = ProcessAndOthers("a")
    other = Alerts(site.services.live, tmp_path / "site.db", lambda *_: None)
    other.open = {"version small 1": Alert("version small 1", "The file has changed.", study="small", by_leader=True)}
    peers.others = [("b", other)]
    alerts = Alerts(live, tmp_path / "site.db", lambda alert, over: told.append((alert.key, over)))
    asyncio.run(alerts.check())
    assert (list(alerts.open), told) == (["version small 1"], [])
    other.open = {}
    asyncio.run(alerts.check())
    assert told == [("version small 1", True)]


def test_an_alert_carries_a_text_for_a_chat_and_parts_for_a_program() -> None:
    alert = Alert("game 7", "ring: P-001 is away.", "/admin/s/ring/game/7", "ring")
    message = message_of(alert, over=False, public_url="https://lab.example/")
    assert message["text"] == "kitchenmind: ring: P-001 is away. https://lab.example/admin/s/ring/game/7"
    assert (message["alert"], message["state"], message["study"]) == ("game 7", "open", "ring")
    assert message_of(alert, over=True, public_url="")["text"] == "kitchenmind: over: ring: P-001 is away."


def test_an_alert_reports_a_database_that_somebody_moved_until_it_is_back(site: PageSite, tmp_path: Path) -> None:
    file = tmp_path / "file.db"
    file.touch()
    alerts = Alerts(site.services.live, file, lambda *_: None)
    asyncio.run(alerts.check())
    file.rename(tmp_path / "moved.db")
    asyncio.run(alerts.check())
    assert "was moved or deleted: nothing is stored" in str(alerts.shown("small")[0]["text"])
    (tmp_path / "moved.db").rename(file)
    asyncio.run(alerts.check())
    assert list(alerts.open) == []
