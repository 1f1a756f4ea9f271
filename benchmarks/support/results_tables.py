"""The tables of `benchmarks/results.py`, as Markdown: accuracy of the predictors, points of the agents."""

from collections.abc import Callable, Mapping, Sequence
from typing import Any, Final

from models.protocols import STEPS

LAYOUTS: Final = ("coordination_ring", "double_rings", "double_counters", "matrix", "clear_division")
SETS: Final = {"published": ("sp", "fcp"), "strong": ("sp_strong", "fcp_strong")}
AGENTS: Final = (*SETS["published"], *SETS["strong"])
FORMS: Final = ("window", "stream")
HUMAN, PLANNER = "human_bc", "planner"
PUBLISHED: Final = {  # the paper's accuracy (%), mean of the three steps, in the order of LAYOUTS
    ("sp", "offline"): (79.42, 70.91, 73.70, 76.08, 73.44),
    ("fcp", "offline"): (89.54, 87.61, 85.40, 76.83, 91.44),
    ("sp", "with humans"): (82.29, 61.77, 65.84, 60.37, 77.88),
    ("fcp", "with humans"): (86.60, 78.34, 76.51, 76.97, 83.13),
}
WARNING: Final = """\
The figures are not directly comparable with the paper's. Only Coordination Ring is the published grid; the other four
are redrawn from its pictures. All agents were trained here and act almost deterministically, which makes them easier to
predict (see the ceiling). Accuracy is measured with partner agents that were used neither for
training nor for early stopping."""

Entry = Mapping[str, Any]
Cells = Mapping[tuple[str, str, str], Entry]  # by layout, agent and form
Row = list[str]


def label(agent: str) -> str:
    """Return how the tables name an agent: as a study does."""
    return "two planners (scripted)" if agent == PLANNER else f"`{agent}`"


def kind(agent: str) -> str:
    """Return the paper's name of an agent's kind, in lower case: sp or fcp."""
    return agent.removesuffix("_strong")


def cells(entries: Sequence[Entry]) -> Cells:
    """Return the figures of the predictors by layout, agent and form."""
    return {(entry["layout"], entry["agent"], entry["form"]): entry for entry in entries}


def table(head: Sequence[str], rows: Sequence[Sequence[str]]) -> Row:
    """Return the lines of a table."""
    return [f"| {' | '.join(row)} |" for row in (head, ["---"] * len(head), *rows)]


def head() -> Row:
    """Return the titles of the columns: the kitchens."""
    return ["", *(name.replace("_", " ").title() for name in LAYOUTS)]


def summary(entries: Sequence[Entry], agents: Sequence[Entry]) -> Row:
    """Return the lines of the small table in README.md."""
    found = cells(entries)
    rows = []
    for agent in SETS["published"]:
        ours = [found[layout, agent, "window"] for layout in LAYOUTS]
        accuracy = [f"{entry['accuracy']['mean']:.1f} ({entry['ceiling_step1']:.0f})" for entry in ours]
        rows.append([f"{label(agent)}: accuracy in % (ceiling of step 1)", *accuracy])
        rows.append(["the paper's", *(f"{value:.1f}" for value in PUBLISHED[agent, "offline"])])
    points = _points_by_cell(agents)
    rows += [
        [f"{label(agent)}, held-out partners: points", *(points[agent, name, "held_out"] for name in LAYOUTS)]
        for agent in AGENTS
    ]
    return table(head(), rows)


def accuracy(entries: Sequence[Entry], observers: Sequence[Entry], agents: Sequence[str], forms: Sequence[str]) -> Row:
    """Return the lines of the table of accuracy of these agents' predictors (a dash: there is none), and a sentence
    that names what is not above the paper. `observers`: the accuracy of an observer who knows both agents."""
    found = cells(entries)
    known = {(one["layout"], one["agent"]): one for one in observers}
    rows, below = [], []
    for agent in agents:
        rows.append([f"{label(agent)}, the paper", *(f"{value:.2f}" for value in PUBLISHED[kind(agent), "offline"])])
        for form in forms:
            ours = [found.get((layout, agent, form)) for layout in LAYOUTS]
            rows += _rows_of_form(f"{label(agent)}, {form}", ours)
            below += _not_above(agent, [entry and entry["accuracy"]["mean"] for entry in ours], f" ({form})")
        rows += _rows_of_observers([known.get((layout, agent)) for layout in LAYOUTS])
        rows += _rows_of_games([_of_any_form(found, layout, agent) for layout in LAYOUTS])
    missed = ["", f"Not above the paper's figure: {', '.join(below)}."] if below else []
    out_of_reach = [
        cell
        for agent in agents
        for cell in _not_above(agent, [_mean(known.get((layout, agent))) for layout in LAYOUTS])
    ]
    if out_of_reach:
        missed.append(f"With these agents, not even the observer is above it: {', '.join(out_of_reach)}.")
    return [*table(head(), rows), *missed]


def _not_above(agent: str, ours: Sequence[float | None], form: str = "") -> list[str]:
    """Return the cells whose accuracy is not above the paper's."""
    papers = PUBLISHED[kind(agent), "offline"]
    return [
        f"{label(agent)}{form} in {name}"
        for name, mean, paper in zip(head()[1:], ours, papers, strict=True)
        if mean is not None and mean <= paper
    ]


def _mean(observer: Entry | None) -> float | None:
    return None if observer is None else sum(observer["steps"]) / STEPS


def _rows_of_observers(observers: Sequence[Entry | None]) -> list[Row]:
    """Return the rows of the best accuracy that is possible."""
    return [
        _row("an observer who knows both agents", observers, lambda one: f"{_mean(one):.1f}"),
        _row("steps 1 / 2 / 3", observers, lambda one: " / ".join(f"{step:.1f}" for step in one["steps"])),
    ]


def _rows_of_form(name: str, ours: Sequence[Entry | None]) -> list[Row]:
    """Return the rows of one form of predictor in all kitchens."""
    return [
        _row(f"**{name}**", ours, lambda entry: f"**{entry['accuracy']['mean']:.2f}**"),
        _row("steps 1 / 2 / 3", ours, lambda one: " / ".join(f"{one['accuracy'][f'step{k}']:.1f}" for k in (1, 2, 3))),
        _row("without stuck timesteps", ours, lambda entry: f"{entry['not_stuck']['mean']:.1f}"),
        _row("calibration error", ours, lambda entry: f"{entry['ece']:.3f}"),
    ]


def _rows_of_games(ours: Sequence[Entry | None]) -> list[Row]:
    """Return the rows that are the same for both forms: the predicted games are."""
    return [
        _row("ceiling of step 1", ours, lambda entry: f"{entry['ceiling_step1']:.1f}"),
        _row(
            "baselines: last action again / most frequent",
            ours,
            lambda entry: f"{entry['baselines']['repeat']:.1f} / {entry['baselines']['frequent']:.1f}",
        ),
    ]


def _row(name: str, ours: Sequence[Entry | None], shown: Callable[[Entry], str]) -> Row:
    return [name, *("–" if entry is None else shown(entry) for entry in ours)]


def _of_any_form(found: Cells, layout: str, agent: str) -> Entry | None:
    return next((found[layout, agent, form] for form in FORMS if (layout, agent, form) in found), None)


def points(agents: Sequence[Entry]) -> Row:
    """Return the lines of the table of points: every agent with itself and with held-out partners, where measured;
    and a sentence that names where FCP does not earn more than SP."""
    found = _points_by_cell(agents)
    words = {"self_play": "with itself", "held_out": "held-out partners"}
    rows = [
        [f"{label(agent)}, {words[key]}", *(found.get((agent, layout, key), "–") for layout in LAYOUTS)]
        for agent in (*AGENTS, PLANNER)
        for key in words
        if any((agent, layout, key) in found for layout in LAYOUTS)
    ]
    missed = not_above_sp(agents)
    sentence = f"FCP does not earn more with held-out partners than SP: {', '.join(missed)}."
    return [*table(head(), rows), *(["", sentence] if missed else [])]


def not_above_sp(agents: Sequence[Entry]) -> list[str]:
    """Return the cells in which FCP earns no more with held-out partners than SP of the same set, as in the paper's
    claim about FCP."""
    means = {(one["agent"], one["layout"]): one["held_out"]["mean"] for one in agents if "held_out" in one}
    return [
        f"{label(fcp)} in {name}"
        for sp, fcp in SETS.values()
        for name, layout in zip(head()[1:], LAYOUTS, strict=True)
        if {(sp, layout), (fcp, layout)} <= set(means) and means[fcp, layout] <= means[sp, layout]
    ]


def _points_by_cell(agents: Sequence[Entry]) -> dict[tuple[str, str, str], str]:
    return {
        (entry["agent"], entry["layout"], key): f"{entry[key]['mean']:.0f} ± {entry[key]['se']:.0f}"
        for entry in agents
        for key in ("self_play", "held_out")
        if key in entry
    }


def with_human(entries: Sequence[Entry], measured: Sequence[Entry]) -> Row:
    """Return the lines of the table of accuracy with a behaviour-cloned human."""
    found = cells(entries)
    rows = []
    for entry in measured:
        agent, form = entry["agent"], entry["form"]
        offline = found[entry["layout"], agent, form]["accuracy"]["mean"]
        published = (f"{PUBLISHED[kind(agent), when][0]:.2f}" for when in ("offline", "with humans"))
        figures = [offline, entry["accuracy"]["mean"]]
        rows.append(
            [
                f"{label(agent)} ({form})",
                *(f"{figure:.2f}" for figure in figures),
                f"{entry['ceiling_step1']:.1f}",
                " → ".join(published),
            ]
        )
    return table(["", "offline", "with human_bc", "its ceiling of step 1", "the paper, offline → with humans"], rows)


def next_interactions(entries: Sequence[Entry], agents: Sequence[str], form: str) -> Row:
    """Return the lines of the table of how often the agent's next interaction is predicted, by time before it is
    done."""
    found = cells(entries)
    rows: list[Row] = []
    for agent in agents:
        ours = [found[layout, agent, form]["intentions"] for layout in LAYOUTS]
        name = label(agent)
        rows += [
            [f"**{name}, {int(timesteps) // 5} s before**", *(_share_of_both(one["before"][timesteps]) for one in ours)]
            for timesteps in ours[0]["before"]
        ]
        rows += [
            [f"{name}, {words}: 1 / 2 / 4 s", *(_at_all_times(one, key) for one in ours)]
            for key, words in (
                ("first_two", "it or the runner-up"),
                ("nearest_sensible", "nearest station that makes sense"),
                ("frequent", "most frequent for hand and pots"),
                ("states", "states"),
            )
        ]
        rows += [
            [f"{name}, all states (none within 4 s)", *(f"{e['all_states']:.1f} ({e['none']:.1f})" for e in ours)],
            [f"{name}, calibration error", *(f"{one['ece']:.3f}" for one in ours)],
            [f"{name}, mean error of when, timesteps", *(f"{one['when_error']:.1f}" for one in ours)],
        ]
    return table(head(), rows)


def _share_of_both(values: Entry) -> str:
    return "-" if values["kind"] is None else f"**{values['kind_and_station']:.1f}** ({values['kind']:.1f})"


def _at_all_times(entry: Entry, key: str) -> str:
    values = [each[key] for each in entry["before"].values()]
    return " / ".join("-" if value is None else f"{value:,}" if key == "states" else f"{value:.1f}" for value in values)
