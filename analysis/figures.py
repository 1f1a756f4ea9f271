"""The report's figures: result rows in, matplotlib figures out."""

import math
from collections.abc import Mapping, Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Patch
from matplotlib.ticker import MaxNLocator
from numpy.typing import NDArray
from scipy import stats

from analysis.accuracy_text import predictor_words
from analysis.figure_style import ACCENT, CARD, FILLS, INK, SOFT, fill, new_figure, styled
from analysis.formatting import agent_title, condition_title, layout_title, partner_title, stars
from analysis.power import Power
from analysis.results import Result, select

IN_ONE_ROW = 3  # conditions of the published design; more have a legend of their own below, and narrower bars
NEXT_TO = 0.265  # from bar to bar, of the distance between two groups
GROUP = 0.9  # the widest group


def _legend(figure: Figure, panel: Axes, conditions: Sequence[str]) -> None:
    patches = []
    for condition in conditions:
        edge, face, hatch = fill(condition, conditions)
        patches.append(Patch(facecolor=face, edgecolor=edge, hatch=hatch, label=condition_title(condition)))
    if len(patches) > IN_ONE_ROW:
        figure.legend(handles=patches, loc="outside lower center", ncols=min(len(patches), 4))
    else:
        panel.legend(handles=patches, loc="lower right", bbox_to_anchor=(1, 0.98), ncols=len(patches), borderaxespad=0)


def _step(conditions: Sequence[str]) -> float:
    """Return the distance of the bars of a group, so that it does not reach into the next group."""
    return min(NEXT_TO, GROUP / max(1, len(conditions)))


def _legend_rows(conditions: Sequence[str]) -> int:
    return math.ceil(len(conditions) / 4) if len(conditions) > IN_ONE_ROW else 0


def _bar(panel: Axes, x: float, row: Result, conditions: Sequence[str], half: float, decimals: int) -> float:
    """Draw one mean with its error bar and number; return how high it reaches."""
    edge, face, hatch = fill(row.condition, conditions)
    step = _step(conditions)
    panel.bar(x, row.estimate, 0.83 * step, facecolor=face, edgecolor=edge, hatch=hatch, linewidth=1.1, zorder=2)
    half = 0.0 if math.isnan(half) else half
    if half:
        panel.plot([x, x], [row.estimate - half, row.estimate], color=CARD, linewidth=3, zorder=3)
        panel.errorbar(x, row.estimate, half, color=INK, capsize=2.6, elinewidth=1, capthick=1, zorder=4)
    top = row.estimate + half
    panel.annotate(
        f"{row.estimate:.{decimals}f}",
        (x, top),
        (0, 2.5),
        textcoords="offset points",
        ha="center",
        fontsize=7.6 if step == NEXT_TO else 6,
        rotation=0 if step == NEXT_TO else 90,
        color=SOFT,
    )
    return top


def _group_places(conditions: Sequence[str]) -> dict[str, float]:
    spread = (np.arange(len(conditions)) - (len(conditions) - 1) / 2) * _step(conditions)
    return dict(zip(conditions, spread.tolist(), strict=True))


@styled
def rewards(rows: Sequence[Result], conditions: Sequence[str], contrast: tuple[str, str] | None) -> Figure:
    """Draw mean reward with standard error by agent (panels), layout and condition; brackets where `contrast` is
    significant after correction."""
    means = select(rows, section="reward", test="mean")
    agents = list(dict.fromkeys(row.agent for row in means))
    layouts = list(dict.fromkeys(row.layout for row in means))
    figure, panels = new_figure(0.35 + 2.35 * len(agents) + 0.22 * _legend_rows(conditions), len(agents))
    top = max((row.estimate + (0 if math.isnan(row.se) else row.se) for row in means), default=1.0) or 1.0
    places = _group_places(conditions)
    for panel, agent in zip(panels, agents, strict=True):
        for index, layout in enumerate(layouts):
            bars = select(means, agent=agent, layout=layout)
            tops = [_bar(panel, index + places[row.condition], row, conditions, row.se, 0) for row in bars]
            mark = _mark(rows, layout, agent, contrast)
            if mark and contrast:
                _bracket(panel, mark, [index + places[name] for name in contrast], max(tops), top)
        if layouts[-1] == "all" and len(layouts) > 1:
            panel.axvline(len(layouts) - 1.5, color=SOFT, linewidth=0.8, linestyle=(0, (3, 3)))
        panel.set_title(partner_title(agent))
        panel.set_xticks(range(len(layouts)), [layout_title(layout) for layout in layouts])
        panel.set_xlim(-0.55, len(layouts) - 0.45)
        panel.set_ylim(0, top * 1.26)
        panel.yaxis.set_major_locator(MaxNLocator(5))
        panel.grid(axis="y")
    _legend(figure, panels[0], conditions)
    return figure


def _mark(rows: Sequence[Result], layout: str, agent: str, contrast: tuple[str, str] | None) -> str:
    tests = select(rows, section="reward", test="t_test_people", layout=layout, agent=agent)
    return "".join(stars(row.p_adjusted) for row in tests if row.contrast == " - ".join(contrast or ()))


def _bracket(panel: Axes, mark: str, ends: Sequence[float], height: float, top: float) -> None:
    """Draw a bracket with its stars over two bars; `top` is the height for which the panel is scaled."""
    left, right = sorted(ends)
    low, high = height + top * 0.1, height + top * 0.125
    panel.plot([left, left, right, right], [low, high, high, low], color=INK, linewidth=0.9)
    middle = ((left + right) / 2, high)
    panel.annotate(mark, middle, (0, -3), textcoords="offset points", ha="center", fontsize=9, va="bottom")


@styled
def effect_sizes(rows: Sequence[Result], contrast: tuple[str, str]) -> Figure:
    """Draw Hedges g with interval for every layout and agent; filled where significant after correction."""
    tests = select(rows, section="reward", test="t_test_people", contrast=" - ".join(contrast))
    tests = [row for row in tests if not math.isnan(row.effect) and row.agent != "all"]
    figure, (panel,) = new_figure(0.9 + 0.24 * len(tests))
    labels, y = [], 0.0
    for index, row in enumerate(tests):
        y += 0.5 if index and row.agent != tests[index - 1].agent else 0.0
        sure = row.p_adjusted < 0.05
        panel.plot([row.ci_low, row.ci_high], [y, y], color=INK, linewidth=1.1, zorder=2)
        face = FILLS["tom"][0] if sure else CARD
        panel.plot(row.effect, y, "s", color=FILLS["tom"][0], markerfacecolor=face, markersize=5.5, zorder=3)
        text = f"{row.effect:.2f} [{row.ci_low:.2f}, {row.ci_high:.2f}]".replace("-", "−")
        panel.annotate(text, (1.015, y), xycoords=("axes fraction", "data"), va="center", fontsize=8)
        labels.append((y, f"{agent_title(row.agent)}  {layout_title(row.layout)}"))
        y += 1
    panel.axvline(0, color=SOFT, linewidth=0.8)
    panel.set_yticks([place for place, _ in labels], [label for _, label in labels])
    panel.tick_params(axis="y", labelcolor=INK)
    panel.set_ylim(y - 0.4, -0.6)
    first, second = (condition_title(name) for name in contrast)
    panel.set_xlabel(f"{second} better   ←   Hedges’ g, 95 % interval   →   {first} better")
    panel.grid(axis="x")
    return figure


@styled
def questionnaire(rows: Sequence[Result], conditions: Sequence[str], titles: Mapping[str, str]) -> Figure:
    """Draw mean answers with 95 % interval by agent (panels), question and condition."""
    means = select(rows, section="questionnaire", test="mean")
    agents = list(dict.fromkeys(row.agent for row in means))
    questions = list(dict.fromkeys(row.question for row in means))
    figure, panels = new_figure(0.35 + 1.75 * len(agents) + 0.22 * _legend_rows(conditions), len(agents))
    places = _group_places(conditions)
    for panel, agent in zip(panels, agents, strict=True):
        for index, question in enumerate(questions):
            bars = {row.condition: row for row in select(means, agent=agent, question=question)}
            for condition in conditions:
                x = index + places[condition]
                if condition in bars:
                    row = bars[condition]
                    _bar(panel, x, row, conditions, row.estimate_high - row.estimate, 2)
                else:
                    panel.annotate(
                        "not asked",
                        (x, 0.03),
                        xycoords=("data", "axes fraction"),
                        ha="center",
                        va="bottom",
                        fontsize=7,
                        color=SOFT,
                        rotation=90,
                    )
        panel.set_title(partner_title(agent))
        panel.set_xticks(range(len(questions)), [titles[question] for question in questions])
        panel.set_xlim(-0.55, len(questions) - 0.45)
        _answer_axis(panel, means)
        panel.grid(axis="y")
    _legend(figure, panels[0], conditions)
    return figure


def _answer_axis(panel: Axes, means: Sequence[Result]) -> None:
    """Show the published scale, 1 to 7, or more where a question has other answers."""
    low, high = (pick([row.estimate for row in means]) for pick in (min, max))
    if low >= 1 and high <= 7:
        panel.set_ylim(1, 7.4)
        panel.set_yticks([1, 3, 5, 7])
    else:
        panel.set_ylim(min(1.0, math.floor(low)), max(7.4, 1.1 * high))
        panel.yaxis.set_major_locator(MaxNLocator(4, integer=True))


@styled
def accuracy(rows: Sequence[Result], chance: float = 1 / 6) -> Figure:
    """Draw accuracy by step ahead for every agent: filled offline, hollow with people."""
    figure, (panel,) = new_figure(2.5, width_in=4.2)
    ends: list[tuple[float, str]] = []
    for test, style, name in (("offline", "-", "offline"), ("live", "--", "live")):
        for row in select(rows, section="accuracy", test=test, layout="all", step=1):
            if row.condition not in ("", "all"):
                continue
            line = [
                found.estimate * 100
                for found in select(rows, section="accuracy", test=test, layout="all", agent=row.agent)
                if found.step and (found.condition, found.note) == (row.condition, row.note)
            ]
            steps = range(1, len(line) + 1)
            face = INK if test == "offline" else CARD
            panel.plot(steps, line, style, color=INK, linewidth=1.2, marker="o", markersize=4.5, markerfacecolor=face)
            ends.append((line[-1], f"{agent_title(row.agent)} {name}{_which(rows, row)}"))
    _end_labels(panel, ends, 6.5)
    panel.plot([1, 3], [chance * 100] * 2, color=FILLS["random"][0], linewidth=1.2, linestyle=(0, (2, 2)))
    panel.annotate("chance", (3.12, chance * 100), va="center", fontsize=8)
    panel.set_xticks([1, 2, 3])
    panel.set_xlim(0.85, 4.05)
    panel.set_ylim(0, 103)
    panel.set_xlabel("steps ahead")
    panel.set_ylabel("right, %")
    panel.grid(axis="y")
    return figure


def _which(rows: Sequence[Result], row: Result) -> str:
    """Return which of an agent's predictors a line is about, where that is not clear."""
    words = predictor_words(rows, row)
    return f", {words}" if words else ""


def _end_labels(panel: Axes, ends: Sequence[tuple[float, str]], apart: float) -> None:
    """Write names at the ends of lines, moved apart from the top down so that none covers another."""
    place = math.inf
    for value, label in sorted(ends, reverse=True):
        place = min(value, place - apart)
        panel.annotate(label, (3.12, place), va="center", fontsize=8)


@styled
def power(points: Sequence[Power], here: int | None) -> Figure:
    """Draw the power of the test over people by participants, one line per effect; `here` marks this study."""
    figure, (panel,) = new_figure(2.5, width_in=4.2)
    effects = list(dict.fromkeys(point.effect for point in points))
    for effect, style in zip(effects, ("-", "--", ":", "-.") * len(effects), strict=False):
        line = sorted((point.participants, point.people * 100) for point in points if point.effect == effect)
        x, y = zip(*line, strict=True)
        panel.plot(x, y, style, color=FILLS["tom"][0], linewidth=1.5, label=f"{effect:g} points")
    panel.axhline(80, color=SOFT, linewidth=0.8, linestyle=(0, (3, 3)))
    if here is not None:
        panel.axvline(here, color=ACCENT, linewidth=1.2)
        panel.annotate(f"this study, {here}", (here, 3), (4, 0), textcoords="offset points", fontsize=7.6, color=SOFT)
    panel.set_ylim(0, 103)
    panel.set_xlim(left=0)
    panel.set_xlabel("participants in each condition")
    panel.set_ylabel("found, %")
    panel.legend(loc="lower right", bbox_to_anchor=(1, 0.08))
    panel.grid(axis="y")
    return figure


@styled
def quantiles(residuals: NDArray[np.float64]) -> Figure:
    """Draw residuals of the mixed model against a normal distribution."""
    figure, (panel,) = new_figure(2.5, width_in=4.2)
    (theory, found), (slope, middle, _) = stats.probplot(residuals)
    panel.plot(theory, slope * theory + middle, color=SOFT, linewidth=1)
    panel.plot(theory, found, ".", color=INK, markersize=2.5)
    panel.set_xlabel("quantile of a normal distribution")
    panel.set_ylabel("residual, points")
    panel.grid()
    return figure
