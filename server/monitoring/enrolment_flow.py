"""The flow of participants from the link to the analysis: counts by step, reason for leaving and arm."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from sqlalchemy import Connection

from server.store import arrivals, overview
from server.store.overview import Counts, Group
from server.study.definition import Study
from server.study.steps import PHASES, StudyStep, steps

Node = dict[str, Any]  # name, reached, here (now), lost: reason -> how many, flags: what else is known -> how many
_REACHED = {
    "introduction": "Consented",
    "practice": "Began practice",
    "rounds": "Began episodes",
    "finish": "Last pages",
}
GONE = {
    "timed_out": "not seen for too long",
    "returned": "place released",
    "screened_out": "screened out",
    "withdrawn": "withdrew",
}
_UNSUITABLE = {
    "browser": "browser too old, or without cookies",
    "screen": "screen too small",
    "input": "neither keyboard nor touch",
    "latency": "connection too slow",
    "websocket": "connection blocked",
}


@dataclass(frozen=True)
class Stock:
    """The data from which the flow is counted: people or bots, as bots take no person's place and are never added to
    them."""

    counts: Counts
    arrived: Mapping[tuple[str, str], int]  # (kind, reason) -> browsers
    excluded: Mapping[str, int]  # condition -> completed participants whose data are excluded whole
    inattentive: Mapping[tuple[str, int], int] = field(
        default_factory=dict
    )  # (condition, position) -> screened out for it
    failed_a_check: int = 0  # completed participants who failed an attention check
    simulated: bool = False  # all of these are bots
    apart: Counts = field(default_factory=dict)  # bots in a study of people

    @property
    def conditions(self) -> set[str]:
        """The conditions that anybody is or was in, in any version of the study."""
        return {name for name, _, _ in (*self.counts, *self.apart)}


def stock(connection: Connection, group: Group) -> Stock:
    """Read the data."""
    bots = Group(group.study_ids, simulated=True)
    return Stock(
        overview.flow(connection, group),
        arrivals.of_study(connection, group.study_ids),
        overview.excluded(connection, group),
        overview.inattentive(connection, group),
        overview.failed_a_check(connection, group),
        group.simulated,
        {} if group.simulated else overview.flow(connection, bots),
    )


def arms_of(study: Study, held: Stock, names: Mapping[str, str], blind: bool) -> list[dict[str, Any]]:
    """Return each condition with its plan; in blind mode in the order of the masked names. Conditions that only earlier
    versions had follow: nobody new comes to them, but those who did still count."""
    kinds = {condition.name: condition.predictor for condition in study.conditions}
    targets = {condition.name: condition.quota for condition in study.conditions}
    if study.replace_excluded:
        targets = {name: quota and quota + held.excluded.get(name, 0) for name, quota in targets.items()}
    rows = [_arm(name, held) | {"kind": kinds[name], "target": targets[name], "former": False} for name in kinds]
    for name in sorted(held.conditions - kinds.keys()):
        arm = _arm(name, held)
        target = None if None in targets.values() else arm["completed"] + arm["active"]
        rows.append(arm | {"kind": "", "target": target, "former": True})
    named = [row | {"name": names[row["name"]]} | ({"kind": ""} if blind else {}) for row in rows]
    return sorted(named, key=lambda row: (row["former"], str(row["name"]))) if blind else named


def _arm(name: str, held: Stock) -> dict[str, Any]:
    mine, bots = ({key: n for key, n in counts.items() if key[0] == name} for counts in (held.counts, held.apart))
    by_status = {status: _sum(mine, status) for status in ("completed", "active", *GONE)}
    excluded = held.excluded.get(name, 0)
    return {
        "name": name,
        "allocated": sum(by_status.values()),
        "completed": by_status["completed"],
        "active": by_status["active"],
        "dropped": sum(by_status[status] for status in GONE),
        "lost": _gone(mine, {key: n for key, n in held.inattentive.items() if key[0] == name}),
        "excluded": excluded,
        "analysable": by_status["completed"] - excluded,
        "simulated": _sum(bots, "completed") + _sum(bots, "active"),
    }


def flow_of(study: Study, held: Stock) -> list[Node]:
    """Return the flow from the link to the analysis, without the first node if no browser was counted (bots open no
    page)."""
    every_step = steps(study, study.conditions[0].name, study.seed)
    nodes = [_phase(every_step, phase, held) for phase in PHASES if _inside(every_step, phase)]
    excluded = sum(held.excluded.values())
    completed = _sum(held.counts, "completed")
    nodes.append({"name": "Completed", "reached": completed, "here": 0, "lost": _some({"excluded": excluded})})
    nodes[-1]["flags"] = _some({"failed an attention check": held.failed_a_check})
    nodes.append({"name": "Analysable", "reached": completed - excluded, "here": 0, "lost": {}})
    return [*_opened(held.arrived, nodes[0]["reached"]), *nodes]


def _opened(arrived: Mapping[tuple[str, str], int], consented: int) -> list[Node]:
    opened = arrived.get(("opened", ""), 0)
    if not opened:
        return []
    lost = {word: arrived.get(("unsuitable", reason), 0) for reason, word in _UNSUITABLE.items()}
    lost["declined"] = arrived.get(("declined", ""), 0)
    lost["left before consent, reason unknown"] = max(0, opened - consented - sum(lost.values()))
    return [{"name": "Opened the link", "reached": max(opened, consented), "here": 0, "lost": _some(lost)}]


def _inside(every_step: tuple[StudyStep, ...], phase: str) -> list[int]:
    return [index for index, step in enumerate(every_step) if step.phase == phase and step.kind != "thanks"]


def _phase(every_step: tuple[StudyStep, ...], phase: str, held: Stock) -> Node:
    """Return how many reached the first step of the phase, are in it, and left in it."""
    counts = held.counts
    inside = _inside(every_step, phase)
    is_first = min(inside) == min(index for each in PHASES for index in _inside(every_step, each))
    first, last = (0 if is_first else min(inside)), max(inside)
    here = {key: count for key, count in counts.items() if first <= min(key[2], len(every_step) - 1) <= last}
    inattentive = {
        key: count for key, count in held.inattentive.items() if first <= min(key[1], len(every_step) - 1) <= last
    }
    reached = sum(
        count for (_, status, position), count in counts.items() if status == "completed" or position >= first
    )
    name, lost = _REACHED.get(phase, phase), _gone(here, inattentive)
    return {"name": name, "reached": reached, "here": _sum(here, "active"), "lost": lost}


def _gone(counts: Counts, inattentive: Mapping[tuple[str, int], int]) -> dict[str, int]:
    """Return why people left; failed attention checks are separate from other reasons for screening out."""
    lost = {word: _sum(counts, status) for status, word in GONE.items()}
    failed = sum(inattentive.values())
    return _some(lost | {GONE["screened_out"]: lost[GONE["screened_out"]] - failed, "failed attention checks": failed})


def _sum(counts: Counts, wanted: str) -> int:
    return sum(count for (_, status, _), count in counts.items() if status == wanted)


def _some(counts: dict[str, int]) -> dict[str, int]:
    return {word: count for word, count in counts.items() if count}
