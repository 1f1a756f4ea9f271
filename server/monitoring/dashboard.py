"""The dashboard's figures, tables and flow of participants, as JSON; read at most every 2 s, however many pages are
open.
"""

import asyncio
import shutil
import time
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from sqlalchemy import Connection

from server.monitoring.arm_names import arm_names
from server.monitoring.data_quality import DataQuality
from server.monitoring.enrolment_flow import GONE, arms_of, flow_of, stock
from server.monitoring.live_games import LiveGames
from server.participation.served_studies import Studies
from server.store import interventions, overview, participants, study_openings
from server.store.accuracy import RunningAccuracy, wilson
from server.store.overview import Person
from server.store.wrong_displays import DisplayCount
from server.study.definition import Study
from server.study.steps import StudyStep, steps

FRESH_S = 1.8
ACCURACY_EVERY_S = 10.0


class Dashboard:
    """One per server: caches recent reads, and keeps the running count of hits of each study."""

    def __init__(self, live: LiveGames, database_file: Path | None) -> None:
        self._live, self.file = live, database_file
        self._kept: dict[tuple[str, str, bool], tuple[float, dict[str, Any]]] = {}
        self._accuracy: dict[str, tuple[float, RunningAccuracy]] = {}
        self._displays: dict[str, tuple[float, DisplayCount]] = {}
        self._reading = asyncio.Lock()
        self.quality = DataQuality(live.web.database)

    async def of(self, study_ids: tuple[int, ...], study: Study, tab: str, blind: bool) -> dict[str, Any]:
        """Return all figures of a study, and the participants of one tab. Raises DatabaseDown."""
        key = (study.name, tab, blind)
        async with self._reading:
            kept = self._kept.get(key)
            if kept is None or time.monotonic() - kept[0] > FRESH_S:
                accuracy = await self._count(study_ids, study.name)
                display = await self._count_displays(study_ids, study.name)
                await self.quality.check_new(study_ids)
                made = await self._live.web.database.read(self._read, study_ids, study, tab, blind)
                made |= {"accuracy": accuracy_of(accuracy), "machine": await self._machine()}
                made["display"] = await self._display_of(study_ids, display)
                kept = self._kept[key] = (time.monotonic(), made)
            return kept[1]

    async def _count(self, study_ids: tuple[int, ...], name: str) -> RunningAccuracy:
        counted, accuracy = self._accuracy.get(name, (-1e9, RunningAccuracy()))
        if accuracy.waiting or time.monotonic() - counted > ACCURACY_EVERY_S:
            await self._live.web.database.read(accuracy.count, study_ids)
            self._accuracy[name] = (time.monotonic(), accuracy)
        return accuracy

    async def _count_displays(self, study_ids: tuple[int, ...], name: str) -> DisplayCount:
        counted, display = self._displays.get(name, (-1e9, DisplayCount()))
        if display.waiting or time.monotonic() - counted > ACCURACY_EVERY_S:
            await self._live.web.database.read(display.count, study_ids)
            self._displays[name] = (time.monotonic(), display)
        return display

    async def _display_of(self, study_ids: tuple[int, ...], display: DisplayCount) -> dict[str, int]:
        """Count timesteps not shown as the condition requires, in ended and running games."""
        here, elsewhere = await self._live.cards(study_ids), await self._live.views(study_ids)
        running = [card.game.session.frames.violations for card in here]
        running += [view.display_violations for view in elsewhere]
        late = [card.game.session.frames.late_violations for card in here]
        late += [view.display_late for view in elsewhere]
        return {
            "timesteps": display.timesteps + sum(running),
            "late": display.late + sum(late),
            "games": display.episodes + sum(count > 0 for count in running),
        }

    def _read(
        self, connection: Connection, study_ids: tuple[int, ...], study: Study, tab: str, blind: bool
    ) -> dict[str, Any]:
        group = overview.group_to_show(connection, study_ids)
        held = stock(connection, group)
        names = arm_names(study, blind, held.conditions)
        took = overview.minutes(connection, group)
        rows = overview.people(connection, study_ids, tab)
        quality = self.quality.by_person()
        shown = {} if blind else names
        return {
            "people": [self._row(person, shown) | {"quality": quality.get(person.id, {})} for person in rows],
            "tab": tab,
            "here": overview.here_now(connection, group),
            "simulated": overview.simulated(connection, study_ids),
            "rehearsal": group.simulated,
            "minutes": [round(_quantile(took, part), 1) for part in (0.25, 0.5, 0.75)] if took else None,
            "arms": arms_of(study, held, names, blind),
            "flow": flow_of(study, held),
            "stored": overview.stored(connection, study_ids),
            "paused": study.name in interventions.paused_studies(connection),
            "closed": study.name in study_openings.closed(connection),
            "client_errors": [
                {"at": at.isoformat(), "person": person, "who": who, "text": text}
                for at, person, who, text in overview.client_errors(connection, study_ids)
            ],
        }

    def _row(self, person: Person, arms: dict[str, str]) -> dict[str, Any]:
        sequence = steps_of(self._live.web.studies, person)
        step = sequence[min(person.position, len(sequence) - 1)]
        until = person.completed_at or person.last_seen_at
        return {
            "id": person.id,
            "who": participants.label(person.number, person.simulated),
            "status": person.status,
            "now": step_name(step) if person.status == "active" else GONE.get(person.status, "completed"),
            "done": person.position if person.status != "completed" else len(sequence),
            "steps": len(sequence),
            "seen_s": max(0, round((datetime.now(UTC) - person.last_seen_at).total_seconds())),
            "minutes": round((until - person.started_at).total_seconds() / 60),
            "arm": arms.get(person.condition, ""),
            "client_errors": person.client_errors,
            "excluded": person.excluded,
        }

    async def _machine(self) -> dict[str, Any]:
        live = self._live
        others = await live.peers.processes()
        late = live.games.loop.lateness.last(most=2000)
        models = sorted(live.models_ms)
        found: dict[str, Any] = {
            "late_ms": [round(_quantile(late, part), 1) for part in (0.5, 0.99)] if late else None,
            "models_ms": [round(_quantile(models, part), 1) for part in (0.5, 0.99)] if models else None,
            "games": len(live.games),
            "moving": live.games.loop.moving,
            "sockets": len(live.sockets),
        }
        for process in others:  # how late they are where it is worst
            if process.figures.get("ticks_total"):
                theirs = [round(1000 * process.figures[f"tick_lateness_seconds_p{part}"], 1) for part in (50, 99)]
                found["late_ms"] = list(map(max, theirs, found["late_ms"] or theirs))
        for what in ("games", "moving", "sockets"):
            found[what] += sum(int(process.figures.get(what, 0)) for process in others)
        if self.file is not None and self.file.exists():
            parts = [self.file, self.file.with_name(self.file.name + "-wal")]
            found["database_mb"] = round(sum(part.stat().st_size for part in parts if part.exists()) / 1e6, 1)
            found["disk_free_gb"] = round(shutil.disk_usage(self.file.parent).free / 1e9, 1)
        return found


def steps_of(studies: Studies, person: Person) -> tuple[StudyStep, ...]:
    """Return all steps of a participant."""
    study = studies.version(person.study_id)
    if study is None:
        return (StudyStep("unknown", "page", "finish"),)
    return steps(study, person.condition, person.seed, (person.allocation_number - 1) // len(study.conditions))


def step_name(step: StudyStep) -> str:
    """Return the page's name of a step."""
    words: dict[str, str] = {"episode": f"Episode {step.number}", "ready": f"Before episode {step.number}"}
    if step.kind == "questionnaire" and step.number:
        return f"Questions after {step.number}"
    return words.get(step.kind, (step.page or step.kind).replace("_", " ").capitalize())


def accuracy_of(accuracy: RunningAccuracy) -> dict[str, Any]:
    """Return shares with intervals, per agent and layout, over the three steps and for each step alone."""
    rows = []
    for (agent, layout), hits in sorted(accuracy.hits.items()):
        share, low, high = wilson(sum(hits.right), sum(hits.asked))
        by_step = [round(wilson(right, asked)[0], 4) for right, asked in zip(hits.right, hits.asked, strict=True)]
        row = {"agent": agent, "layout": layout, "episodes": hits.episodes, "n": sum(hits.asked), "steps": by_step}
        row |= {"share": round(share, 4), "low": round(low, 4), "high": round(high, 4)}
        rows.append(row | {"intention": shares(hits.intentions_right, hits.intentions)})
    right = sum(sum(hits.right) for hits in accuracy.hits.values())
    asked = sum(sum(hits.asked) for hits in accuracy.hits.values())
    return {"rows": rows, "overall": shares(right, asked), "n": asked, "waiting": accuracy.waiting}


def shares(right: int, asked: int) -> list[float] | None:
    """Return a share with its interval, as the page shows it; None of nothing."""
    return [round(value, 4) for value in wilson(right, asked)] if asked else None


def _quantile(ordered: list[float], part: float) -> float:
    return ordered[min(len(ordered) - 1, int(part * len(ordered)))]
