"""The dashboard's figures, tables and flow of participants, as JSON; read at most every 2 s however many watch."""

import asyncio
import shutil
import time
from collections.abc import Callable
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from sqlalchemy import Connection

from server.store import decisions, overview
from server.store.accuracy import Accuracy, wilson
from server.store.overview import Counts, Person
from server.study.plan import Study
from server.study.steps import PHASES, Step, steps
from server.web.admin_page import arm_names
from server.web.live import Live
from server.web.studies import Studies

FRESH_S = 1.8
ACCURACY_EVERY_S = 10.0
_REACHED = {
    "introduction": "Consented",
    "practice": "Began practice",
    "rounds": "Began episodes",
    "finish": "Last pages",
}
_GONE = {
    "timed_out": "not seen for too long",
    "returned": "place released",
    "screened_out": "screened out",
    "withdrawn": "withdrew",
}


class Figures:
    """One for the server: keeps what was read lately, and the running count of hits of each study."""

    def __init__(self, live: Live, database_file: Path | None) -> None:
        self._live, self._file = live, database_file
        self._kept: dict[tuple[str, str, bool], tuple[float, dict[str, Any]]] = {}
        self._accuracy: dict[str, tuple[float, Accuracy]] = {}
        self._reading = asyncio.Lock()

    async def of(self, study_ids: tuple[int, ...], study: Study, tab: str, blind: bool) -> dict[str, Any]:
        """All figures of a study, and the participants of one tab. Raises DatabaseDown."""
        key = (study.name, tab, blind)
        async with self._reading:
            kept = self._kept.get(key)
            if kept is None or time.monotonic() - kept[0] > FRESH_S:
                accuracy = await self._count(study_ids, study.name)
                made = await self._live.web.database.read(self._read, study_ids, study, tab, blind)
                made |= {"accuracy": accuracy_of(accuracy), "machine": self._machine()}
                kept = self._kept[key] = (time.monotonic(), made)
            return kept[1]

    async def _count(self, study_ids: tuple[int, ...], name: str) -> Accuracy:
        counted, accuracy = self._accuracy.get(name, (-1e9, Accuracy()))
        if accuracy.waiting or time.monotonic() - counted > ACCURACY_EVERY_S:
            await self._live.web.database.read(accuracy.count, study_ids)
            self._accuracy[name] = (time.monotonic(), accuracy)
        return accuracy

    def _read(
        self, connection: Connection, study_ids: tuple[int, ...], study: Study, tab: str, blind: bool
    ) -> dict[str, Any]:
        counts = overview.flow(connection, study_ids)
        names = arm_names(study, blind)
        took = overview.minutes(connection, study_ids)
        way = steps(study, study.conditions[0].name, study.seed)
        rows = overview.people(connection, study_ids, tab)
        shown = {} if blind else names
        return {
            "people": [self._row(person, shown) for person in rows],
            "tab": tab,
            "here": overview.here_now(connection, study_ids),
            "minutes": [round(_quantile(took, part), 1) for part in (0.25, 0.5, 0.75)] if took else None,
            "arms": arms_of(study, counts, names, blind),
            "flow": flow_of(way, counts, overview.excluded(connection, study_ids)),
            "stored": overview.stored(connection, study_ids),
            "paused": study.name in decisions.paused_studies(connection),
            "troubles": [
                {"at": at.isoformat(), "person": person, "who": f"P-{number:03d}", "text": text}
                for at, person, number, text in overview.troubles(connection, study_ids)
            ],
        }

    def _row(self, person: Person, arms: dict[str, str]) -> dict[str, Any]:
        way = way_of(self._live.web.studies, person)
        step = way[min(person.position, len(way) - 1)]
        until = person.completed_at or person.last_seen_at
        return {
            "id": person.id,
            "who": f"{'B' if person.simulated else 'P'}-{person.number:03d}",
            "status": person.status,
            "now": step_name(step) if person.status == "active" else _GONE.get(person.status, "completed"),
            "done": person.position if person.status != "completed" else len(way),
            "steps": len(way),
            "seen_s": max(0, round((datetime.now(UTC) - person.last_seen_at).total_seconds())),
            "minutes": round((until - person.started_at).total_seconds() / 60),
            "arm": arms.get(person.condition, ""),
            "troubles": person.troubles,
            "excluded": person.excluded,
        }

    def _machine(self) -> dict[str, Any]:
        live = self._live
        late = sorted(list(live.games.loop.late_ms)[-2000:])
        models = sorted(live.models_ms)
        found: dict[str, Any] = {
            "late_ms": [round(_quantile(late, part), 1) for part in (0.5, 0.99)] if late else None,
            "models_ms": [round(_quantile(models, part), 1) for part in (0.5, 0.99)] if models else None,
            "games": len(live.games),
            "moving": live.games.loop.moving,
            "sockets": len(live.sockets),
        }
        if self._file is not None and self._file.exists():
            parts = [self._file, self._file.with_name(self._file.name + "-wal")]
            found["database_mb"] = round(sum(part.stat().st_size for part in parts if part.exists()) / 1e6, 1)
            found["disk_free_gb"] = round(shutil.disk_usage(self._file.parent).free / 1e9, 1)
        return found


def way_of(studies: Studies, person: Person) -> tuple[Step, ...]:
    """All steps of a participant."""
    study = studies.version(person.study_id)
    if study is None:
        return (Step("unknown", "page", "finish"),)
    return steps(study, person.condition, person.seed, (person.number - 1) // len(study.conditions))


def step_name(step: Step) -> str:
    """What the page calls a step of the way."""
    words: dict[str, str] = {"episode": f"Episode {step.number}", "ready": f"Before episode {step.number}"}
    if step.kind == "questionnaire" and step.number:
        return f"Questions after {step.number}"
    return words.get(step.kind, (step.page or step.kind).replace("_", " ").capitalize())


def arms_of(study: Study, counts: Counts, names: dict[str, str], blind: bool) -> list[dict[str, Any]]:
    """Each condition against its plan."""
    rows = []
    for condition in study.conditions:
        mine = {key: count for key, count in counts.items() if key[0] == condition.name}
        rows.append(
            {
                "name": names[condition.name],
                "kind": "" if blind else condition.predictor,
                "completed": _sum(mine, lambda status, _: status == "completed"),
                "active": _sum(mine, lambda status, _: status == "active"),
                "dropped": _sum(mine, lambda status, _: status in overview.DROPPED),
                "target": condition.quota,
            }
        )
    return sorted(rows, key=lambda row: str(row["name"])) if blind else rows


def flow_of(way: tuple[Step, ...], counts: Counts, excluded: int) -> list[dict[str, Any]]:
    """From consent to the analysis: how many got so far, who is there now, who left and why. Consent comes first."""
    phases = [phase for phase in PHASES if any(step.phase == phase for step in way)]
    nodes: list[dict[str, Any]] = []
    for phase in phases:
        inside = [index for index, step in enumerate(way) if step.phase == phase and step.kind != "thanks"]
        if not inside:
            continue
        first, last = (0 if not nodes else min(inside)), max(inside)
        here = {key: count for key, count in counts.items() if first <= min(key[2], len(way) - 1) <= last}
        lost = {
            word: _sum(here, lambda found, _, status=status: found == status)  # type: ignore[misc]
            for status, word in _GONE.items()
        }
        reached = _sum(counts, lambda status, position, first=first: status == "completed" or position >= first)  # type: ignore[misc]
        active = _sum(here, lambda status, _: status == "active")
        nodes.append({"name": _REACHED.get(phase, phase), "reached": reached, "here": active, "lost": _some(lost)})
    completed = _sum(counts, lambda status, _: status == "completed")
    nodes.append({"name": "Completed", "reached": completed, "here": 0, "lost": _some({"excluded": excluded})})
    nodes.append({"name": "Analysable", "reached": completed - excluded, "here": 0, "lost": {}})
    return nodes


def accuracy_of(accuracy: Accuracy) -> dict[str, Any]:
    """Shares with intervals, per agent and layout, each over its three steps and for each step alone."""
    rows = []
    for (agent, layout), hits in sorted(accuracy.hits.items()):
        share, low, high = wilson(sum(hits.right), sum(hits.asked))
        by_step = [round(wilson(right, asked)[0], 4) for right, asked in zip(hits.right, hits.asked, strict=True)]
        row = {"agent": agent, "layout": layout, "episodes": hits.episodes, "n": sum(hits.asked), "steps": by_step}
        rows.append(row | {"share": round(share, 4), "low": round(low, 4), "high": round(high, 4)})
    right = sum(sum(hits.right) for hits in accuracy.hits.values())
    asked = sum(sum(hits.asked) for hits in accuracy.hits.values())
    overall = [round(value, 4) for value in wilson(right, asked)] if asked else None
    return {"rows": rows, "overall": overall, "n": asked, "waiting": accuracy.waiting}


def _sum(counts: Counts, wanted: Callable[[str, int], bool]) -> int:
    return sum(count for (_, status, position), count in counts.items() if wanted(status, position))


def _some(counts: dict[str, int]) -> dict[str, int]:
    return {word: count for word, count in counts.items() if count}


def _quantile(ordered: list[float], part: float) -> float:
    return ordered[min(len(ordered) - 1, int(part * len(ordered)))]
