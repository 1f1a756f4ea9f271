"""Check every few seconds for problems that a researcher should know at once. An alert is sent when it begins and when
it is over. It contains no condition and no text of a participant.
"""

import asyncio
import logging
import shutil
from collections.abc import Callable, Iterator
from dataclasses import replace
from datetime import UTC, datetime
from pathlib import Path
from typing import Final

from server.monitoring import invented_participants
from server.monitoring.live_games import LiveGames, who
from server.monitoring.needs_attention import ACT
from server.monitoring.peers import Alert as Alert
from server.monitoring.peers import Process
from server.participation.study_changes import Versions, remedy
from server.play.frames import Frames
from server.play.pause_reasons import DATABASE
from server.store import overview
from server.store.database import DatabaseDown

log = logging.getLogger(__name__)
LOOK_EVERY_S: Final = 5.0
AWAY_S: Final = 15.0  # a participant is disconnected or has the tab hidden for this long
LATE_MS: Final = 50.0  # p99 of the last ticks
LATEST: Final = 2000  # ticks
DISK_GB: Final = 1.0
_UNREADABLE: Final = "unreadable"


def message_of(alert: Alert, over: bool, public_url: str) -> dict[str, str]:
    """Return the message to post: `text` for a chat, the rest for a program."""
    text = f"kitchenmind: {'over: ' if over else ''}{alert.text}"
    link = f"{public_url.rstrip('/')}{alert.path}" if public_url else ""
    state = "over" if over else "open"
    at = datetime.now(UTC).isoformat(timespec="seconds")
    return {"text": f"{text} {link}".strip(), "alert": alert.key, "state": state, "study": alert.study, "at": at}


Tell = Callable[[Alert, bool], None]  # the alert, and whether it is over


class Alerts:
    """Keeps the current alerts in `open`, by key; made once in server.main."""

    def __init__(
        self, live: LiveGames, database_file: Path | None, tell: Tell, versions: Versions | None = None
    ) -> None:
        self.open: dict[str, Alert] = {}
        self._peers: list[Alert] = []  # of other processes, which send their own alerts
        self._leads = False
        self._live, self._file, self._tell, self._versions = live, database_file, tell, versions

    async def run(self) -> None:
        """Check every few seconds, until this is cancelled."""
        while True:
            try:
                await self.check()
            except Exception:
                log.exception("the check for alerts failed")
            await asyncio.sleep(LOOK_EVERY_S)

    async def check(self) -> None:
        """Send the alerts that have begun or ended since the last check."""
        others = await self._live.peers.processes()
        before = self._peers
        self._peers = self._late(others) + [alert for process in others for alert in process.alerts]
        # one process sends alerts that all of them see
        leads = all(self._live.peers.name < other.name for other in others)
        taken_over = self._taken_over(leads, [*self._peers, *before])
        found = {
            alert.key: alert for alert in (*self._machine(leads), *self._changed(leads), *await self._games(leads))
        }
        if _UNREADABLE in found:  # what the database would say of studies is not known: it is not over either
            found = {key: alert for key, alert in self.open.items() if alert.study} | found
        found = taken_over | found  # a process that has just started has not looked at everything yet
        now = datetime.now(UTC)
        for key in self.open.keys() - found.keys():
            self._tell(self.open.pop(key), True)
        for key, alert in found.items():
            known = self.open.get(key)
            self.open[key] = replace(alert, since=now if known is None else known.since)  # with the newest figures
            if known is None:
                self._tell(self.open[key], False)

    def _taken_over(self, leads: bool, of_others: list[Alert]) -> dict[str, Alert]:
        """Where another process leads from now on, it keeps the alerts that the leader has sent: they are neither over
        nor new. Return those that this process takes over now. `of_others`: also of a process that has just ended."""
        taken = {alert.key: alert for alert in of_others if alert.by_leader} if leads and not self._leads else {}
        if not leads:
            self.open = {key: alert for key, alert in self.open.items() if not alert.by_leader}
        self.open = taken | self.open
        self._leads = leads
        return taken

    def shared(self) -> tuple[Alert, ...]:
        """Return the alerts for the dashboards of other processes, without lateness (in the figures) and games (on
        their cards)."""
        return tuple(alert for alert in self.open.values() if alert.key != "late" and not _is_of_game(alert))

    def shown(self, study: str) -> list[dict[str, object]]:
        """Return the alerts of the whole server for a study's dashboard; those of games are on their cards."""
        now = datetime.now(UTC)
        of_all = {(alert.key, alert.text): alert for alert in (*self._peers, *self.open.values())}  # each once
        mine = [alert for alert in of_all.values() if alert.study in ("", study) and not _is_of_game(alert)]
        return [
            {
                "text": one.text,
                "path": one.path if "/game/" in one.path else "",
                "since_s": round((now - (one.since or now)).total_seconds()),
            }
            for one in mine
        ]

    def _late(self, others: list[Process]) -> list[Alert]:
        """Return an alert about each process whose timesteps come late."""
        since = {alert.key: alert.since for alert in self._peers}
        found: list[Alert] = []
        for process in others:
            p99_ms = 1000 * process.figures.get("tick_lateness_seconds_p99", 0.0)
            if p99_ms > LATE_MS:
                key = f"late {process.name}"
                text = f"Timesteps come late in process {process.name}: {p99_ms:.0f} ms at the 99th percentile."
                found.append(Alert(key, text, since=since.get(key) or datetime.now(UTC)))
        return found

    def _machine(self, leads: bool) -> Iterator[Alert]:
        late = self._live.games.loop.lateness.last(most=LATEST)
        if late and late[int(0.99 * len(late))] > LATE_MS:
            p99 = late[int(0.99 * len(late))]
            yield Alert("late", f"Timesteps come late: {p99:.0f} ms at the 99th percentile.")
        if any(DATABASE in game.session.pause_reasons for game in self._live.games):
            yield Alert("database", "The database does not store data: games are paused until it does.")
        if leads and self._file is not None and not self._file.exists():
            text = f"The database {self._file} was moved or deleted: nothing is stored until it is back."
            yield Alert("file", text, by_leader=True)
        elif leads and self._file is not None:
            free_gb = shutil.disk_usage(self._file.parent).free / 1e9
            if free_gb < DISK_GB:
                yield Alert("disk", f"The disk is nearly full: {free_gb:.1f} GB are free.", by_leader=True)

    def _changed(self, leads: bool) -> Iterator[Alert]:
        """Yield study files that differ from the version served."""
        if self._versions is None or not leads:
            return
        for name, changed in list(self._versions.changed.items()):
            text = f"{changed.text} {remedy(self._versions, name)}"
            yield Alert(f"version {name} {changed.sha256[:12]}", text, f"/admin/s/{name}", name, by_leader=True)

    async def _games(self, leads: bool) -> list[Alert]:
        """Yield alerts about people who are away and errors in their browsers; none while the database cannot be
        read."""
        found: list[Alert] = []
        studies = self._live.web.studies
        try:
            for name in studies.names():
                versions = studies.versions(name)
                cards = await self._live.cards(versions)
                found += _displays(name, [card.game.session.frames for card in cards])
                for card in cards:
                    since_s = self._live.since_s(card.flag) or 0
                    if card.flag.level == ACT and since_s >= AWAY_S:
                        text = f"{name}: {who(card.played)} is away ({card.flag.word.lower()}) for {since_s} s."
                        path = f"/admin/s/{name}/game/{card.played.id}"
                        found.append(Alert(f"game {card.played.id}", text, path, name))
                found += await self._client_errors(name, versions) if leads else []
                found_signs = await invented_participants.signs(self._live.web, name, versions, leads)
                path = f"/admin/s/{name}"
                found += [Alert(key, text, path, name, by_leader=True) for key, text in found_signs.items()]
            found += await self._broken()
        except DatabaseDown:
            found.append(Alert(_UNREADABLE, "The database cannot be reached."))
        return found

    async def _broken(self) -> list[Alert]:
        """Return alerts about games that cannot be taken up, until a researcher ends them: their participants wait."""
        live, found = self._live, []
        known = tuple(live.games.broken)
        played = await live.web.database.read(overview.played, *known) if known else {}
        for episode in known:
            game = played.get(episode)
            study = None if game is None or game.is_over else live.web.studies.version(game.study_id)
            if game is None or study is None:
                live.games.broken.discard(episode)
                continue
            text = (
                f"{study.name}: {who(game)} cannot continue the game {game.short_name}: its stored record cannot be "
                "played again, for the reason in the server's log. End the game on its page, and the participant "
                "can continue."
            )
            found.append(Alert(f"broken {episode}", text, f"/admin/s/{study.name}/game/{episode}", study.name))
        return found

    async def _client_errors(self, name: str, versions: tuple[int, ...]) -> list[Alert]:
        lately = datetime.now(UTC) - overview.HERE
        people = await self._live.web.database.read(overview.with_client_errors, versions, lately)
        return [
            Alert(
                f"trouble {person}",
                f"{name}: the browser of {who} reports errors.",
                f"/admin/s/{name}",
                name,
                by_leader=True,
            )
            for person, who in people.items()
        ]


def _is_of_game(alert: Alert) -> bool:
    return alert.key.startswith("game ")


def _displays(name: str, frames: list[Frames]) -> Iterator[Alert]:
    """Yield alerts about running games whose screens did not show what their condition requires."""
    broken, late = sum(one.violations for one in frames), sum(one.late_violations for one in frames)
    games = sum(one.violations > 0 for one in frames)
    if games:
        what = f"{broken} timestep{'s' * (broken != 1)} of {games} running game{'s' * (games != 1)}"
        text = f"{name}: in {what} the screen did not show what the condition requires. {_cause(broken, late)}"
        yield Alert(f"display {name}", text, f"/admin/s/{name}", name)


def _cause(broken: int, late: int) -> str:
    """Say why, and what to do."""
    if late == 0:
        return "The models were not late: look at the server's log for a model that failed."
    slow = "The server was too slow: the models missed their deadline"
    rest = f" in {late} of them; for the others, look at the server's log" if late < broken else ""
    return f"{slow}{rest}. Let fewer people play at once, or give the server more cores."
