"""The style of the report's figures, readable in grey and by colour-blind viewers: none is hollow, random hatched, ToM
solid."""

import re
from collections.abc import Callable, Sequence
from functools import wraps
from io import StringIO
from pathlib import Path
from typing import ParamSpec

from matplotlib import rc_context
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from analysis.simulated_participants import LABEL

INK, SOFT, LINE, CARD = "#22303c", "#5b6873", "#e3d9c8", "#ffffff"
ACCENT = "#b8501f"
# condition -> edge, fill, hatch; conditions that are not in the published design take the others in turn
FILLS = {"none": (SOFT, CARD, ""), "random": ("#7a5195", CARD, "////"), "tom": ("#12737a", "#12737a", "")}
OTHERS = (
    *(("#9a6400", CARD, "...."), ("#9a6400", CARD, "xxxx"), ("#004a99", CARD, "----"), ("#004a99", "#004a99", "")),
    *(("#a02c5a", CARD, "\\\\\\\\"), ("#a02c5a", "#a02c5a", ""), ("#2e6b2e", CARD, "||||"), ("#2e6b2e", "#2e6b2e", "")),
    *((INK, CARD, "++++"), (INK, CARD, "oo"), (INK, "#c9b48f", ""), (INK, INK, "")),
)
WIDTH_IN = 8.6
DPI = 300
Drawn = ParamSpec("Drawn")
STYLE = {
    "font.family": "DejaVu Sans",
    "font.size": 8.5,
    "text.color": INK,
    "axes.labelcolor": SOFT,
    "axes.edgecolor": SOFT,
    "axes.linewidth": 0.8,
    "axes.titlesize": 9.5,
    "axes.titleweight": "bold",
    "axes.titlelocation": "left",
    "axes.axisbelow": True,
    "xtick.color": INK,
    "ytick.color": SOFT,
    "ytick.labelcolor": SOFT,
    "ytick.labelsize": 8,
    "grid.color": LINE,
    "grid.linewidth": 0.8,
    "hatch.linewidth": 0.9,
    "svg.fonttype": "none",
    "text.parse_math": False,  # a dollar sign in a name is a dollar sign
    "legend.frameon": False,
}


def save(figure: Figure, folder: Path, name: str, simulated: bool = False) -> str:
    """Write name.svg and name.png (300 dpi) and return the SVG to put into a page, its ids made unique by name.
    `simulated`: write into the figure that its participants are."""
    with rc_context({**STYLE, "svg.hashsalt": name}):  # type: ignore[arg-type, dict-item, unused-ignore]
        if simulated:
            figure.suptitle(LABEL, x=0.995, ha="right", color=ACCENT, fontsize=7)  # gets room of its own
        figure.savefig(folder / f"{name}.png", dpi=DPI, facecolor=CARD)
        stream = StringIO()
        figure.savefig(stream, format="svg", transparent=True, metadata={"Date": None, "Title": name})
    svg = stream.getvalue()
    (folder / f"{name}.svg").write_text(svg, encoding="utf-8")
    svg = svg[svg.index("<svg") :]
    svg = re.sub(r'(id="|url\(#|href="#)', rf"\g<1>{name}-", svg)
    return re.sub(r"<metadata>.*?</metadata>", "", svg, flags=re.DOTALL)


def styled(draw: Callable[Drawn, Figure]) -> Callable[Drawn, Figure]:
    """Apply the style while the figure is drawn, and nowhere else in the process."""

    @wraps(draw)
    def drawn(*args: Drawn.args, **keywords: Drawn.kwargs) -> Figure:
        with rc_context(STYLE):  # type: ignore[arg-type, unused-ignore]
            return draw(*args, **keywords)

    return drawn


def new_figure(height_in: float, rows: int = 1, width_in: float = WIDTH_IN) -> tuple[Figure, list[Axes]]:
    figure = Figure(figsize=(width_in, height_in), layout="constrained")
    FigureCanvasAgg(figure)
    axes = figure.subplots(rows, 1, squeeze=False)[:, 0]
    for panel in axes:
        panel.spines[["top", "right", "left"]].set_visible(False)
        panel.tick_params(length=0)
    return figure, list(axes)


def fill(condition: str, conditions: Sequence[str]) -> tuple[str, str, str]:
    """Return edge, face and hatch of a condition."""
    if condition in FILLS:
        return FILLS[condition]
    others = [name for name in conditions if name not in FILLS]
    return OTHERS[others.index(condition) % len(OTHERS)]
