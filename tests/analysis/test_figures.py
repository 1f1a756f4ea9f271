"""Figures of studies with more conditions, or other answers, than the published one."""

from itertools import pairwise

import pytest
from matplotlib.figure import Figure
from matplotlib.patches import Rectangle

from analysis import figures
from analysis.figure_style import fill
from analysis.results import Result

LAYOUTS = ("matrix", "double_rings", "all")
QUESTIONS = ("fun", "trust")
COUNTS = (2, 3, 4, 6, 12)


def conditions(count: int) -> tuple[str, ...]:
    return tuple(f"three_order_{number}" for number in range(1, count + 1))


def rewards(names: tuple[str, ...]) -> Figure:
    rows = [
        Result("reward", "mean", layout, agent, condition=name, estimate=60.0, se=5.0)
        for agent in ("sp", "fcp")
        for layout in LAYOUTS
        for name in names
    ]
    return figures.rewards(rows, names, None)


def questionnaire(names: tuple[str, ...], answer: float = 4.0) -> Figure:
    rows = [
        Result("questionnaire", "mean", "chosen", "sp", condition=name, question=question)
        for question in QUESTIONS
        for name in names
    ]
    filled = [
        Result(**{**vars(row), "estimate": answer, "estimate_low": answer - 1, "estimate_high": answer + 1})
        for row in rows
    ]
    return figures.questionnaire(filled, names, {name: name for name in QUESTIONS})


def bars(figure: Figure) -> list[list[Rectangle]]:
    return [[bar for bar in panel.patches if isinstance(bar, Rectangle)] for panel in figure.axes]


@pytest.mark.parametrize("count", COUNTS)
def test_the_bars_of_a_layout_or_question_do_not_reach_into_the_next(count: int) -> None:
    for figure in (rewards(conditions(count)), questionnaire(conditions(count))):
        for panel in bars(figure):
            places = sorted((bar.get_x(), bar.get_x() + bar.get_width()) for bar in panel)
            between = [after[0] - before[1] for before, after in pairwise(places)]
            groups = between[count - 1 :: count]
            assert len(groups) == len(places) // count - 1
            inside = [gap for number, gap in enumerate(between, start=1) if number % count]
            assert min(groups) > max(inside) > 0


@pytest.mark.parametrize("count", COUNTS)
def test_the_legend_covers_neither_bars_nor_titles(count: int) -> None:
    figure = rewards(conditions(count))
    figure.draw_without_rendering()
    first = figure.axes[0]
    legends = [*figure.legends, *filter(None, (panel.get_legend() for panel in figure.axes))]
    (legend,) = legends
    box = legend.get_window_extent()
    assert not box.overlaps(first.patch.get_window_extent().padded(-6))
    titles = [title for panel in figure.axes for title in (panel.title, panel._left_title) if title.get_text()]  # type: ignore[attr-defined]
    assert titles
    assert not any(box.overlaps(title.get_window_extent()) for title in titles)
    assert box.x0 >= 0
    assert box.x1 <= figure.bbox.width
    assert first.get_position().height > 0.2


def test_twelve_conditions_look_different() -> None:
    names = conditions(12)
    assert len({fill(name, names) for name in names}) == 12


@pytest.mark.parametrize(("answer", "low", "high"), [(4.0, 1, 7), (0.4, 0, 7), (62.0, 1, 62), (14.0, 1, 14)])
def test_answers_of_other_scales_are_inside_the_figure(answer: float, low: float, high: float) -> None:
    (panel,) = questionnaire(("none", "tom"), answer).axes
    bottom, top = panel.get_ylim()
    assert bottom <= low
    assert top >= high
    assert all(bottom <= bar.get_height() <= top for bar in panel.patches if isinstance(bar, Rectangle))
