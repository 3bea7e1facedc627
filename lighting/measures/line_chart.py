"""Panels of lines, for light and for dark pages: what something is worth against what it costs.

What is worth most is in colour and has its name at the end of its line, from few lights to many;
what is compared with it is grey, and other ways of ours are thin. The broad band joins the points
than which nothing is both cheaper and better.

Input  : points of chart.py.    Output : SVG and PNG files, legible from 800 pixels of width.
"""

from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import FixedLocator, FuncFormatter, LogLocator

from capture.output import replacing
from lighting.measures.chart import Point, pareto_front
from lighting.measures.themes import THEMES, Theme, settings_of

Cost = Callable[[Point], float]


def milliseconds(point: Point) -> float:
    """Return what most panels show things against."""
    return point.ms


@dataclass(frozen=True)
class Panel:
    """One figure of points against a cost, both on logarithmic axes.

    Attributes
    ----------
    title, figure : str
        What is above the panel, and which of a point's `errors` is in it.
    cost : callable
        From a point to its place from left to right.
    figure_unit, cost_unit : str
        "%" for shares, "ms", or "" for plain numbers.
    cost_ticks : tuple of float
        Where the cost has a tick; by decades if there are none.
    has_front : bool
        Whether the points are marked than which nothing is both cheaper and better.
    """

    title: str
    figure: str
    cost: Cost = milliseconds
    figure_unit: str = "%"
    cost_unit: str = "ms"
    cost_ticks: tuple[float, ...] = ()
    has_front: bool = True


@dataclass(frozen=True)
class Chart:
    """What a chart is, whatever was measured.

    Attributes
    ----------
    title, legend : str
        Two lines of text above it; what was measured stands between them.
    panels : tuple of Panel
        Two in a row. One whose figure no point has is left out.
    favourite : str
        The system whose colour is the first one.
    """

    title: str
    legend: str
    panels: tuple[Panel, ...]
    favourite: str


def _plain(number: float, _: object) -> str:
    """Return a number as short as it can be said: 64, 30k, 1M."""
    if number >= 1e6:
        return f"{number / 1e6:g}M"
    return f"{number / 1e3:g}k" if number >= 1e4 else f"{number:g}"


_WITH_UNIT: dict[str, Callable[[float, object], str]] = {
    "%": lambda share, _: f"{100 * share:g} %",
    "ms": lambda ms, _: f"{ms:g} ms" if ms < 1e3 else f"{ms / 1e3:g} s",
    "": _plain,
}
_MARKERS = "osD^v"
_NAME_SIZE_PX = (6.3, 15.0)
"""Width of a letter and height of a line of names, at the 100 dots per inch of a figure."""
_NUMBER_SIZE_PX = (34, 24)
"""Room of a number of up to four digits."""


def draw(
    points: Sequence[Point],
    chart: Chart,
    own: Sequence[str],
    about: str,
    path: Path,
    theme: str = "light",
) -> None:
    """Write the chart as the suffix of `path` says, .svg or .png.

    Parameters
    ----------
    points : sequence of Point
        Those of a system in the order of its line.
    chart : Chart
    own : sequence of str
        Systems that may be in colour: of many, the favourite and those most often on a front.
    about : str
        What was measured and on what, one line below the title.
    path : Path
        Replaced if it exists.
    theme : str
        "light" or "dark".
    """
    colours = THEMES[theme]
    panels = [
        panel for panel in chart.panels if any(panel.figure in point.errors for point in points)
    ]
    styles = _styles(points, own, panels, chart.favourite, colours)
    with mpl.rc_context(settings_of(colours)):
        rows = -(-len(panels) // 2)
        figure = Figure(figsize=(10, 1.0 + 4.3 * rows), facecolor=colours.page)
        inches = figure.get_figheight()
        grid = figure.add_gridspec(
            rows, 2, left=0.065, right=0.985, top=1 - 1.2 / inches, bottom=0.35 / inches,
            wspace=0.16, hspace=0.2,
        )  # fmt: skip
        figure.text(0.012, 1 - 0.33 / inches, chart.title, fontsize=14, weight="bold")
        figure.text(0.012, 1 - 0.56 / inches, about, fontsize=8.5)
        figure.text(0.012, 1 - 0.75 / inches, chart.legend, fontsize=8.5)
        for number, panel in enumerate(panels):
            axis = figure.add_subplot(grid[number // 2, number % 2])
            _draw_panel(axis, points, panel, styles, colours)
        with replacing(path) as partial:
            metadata = {"Date": None} if path.suffix == ".svg" else None
            figure.savefig(partial, dpi=160, metadata=metadata)


def _styles(
    points: Sequence[Point],
    own: Sequence[str],
    panels: Sequence[Panel],
    favourite: str,
    theme: Theme,
) -> dict[str, dict[str, Any]]:
    """Return how each system's line is drawn; what is to be named has a label."""
    systems = list(dict.fromkeys(point.system for point in points))
    on_fronts = Counter(
        point.system
        for panel in panels
        if panel.has_front
        for point in pareto_front(points, panel.figure, panel.cost)
    )
    by_worth = sorted(own, key=lambda name: (name != favourite, -on_fronts[name]))
    if len(own) <= len(theme.colours):  # so that several charts have the same colours
        by_worth = list(own)
    named = [name for name in by_worth if name in systems][: len(theme.colours)]
    styles = {}
    for name in systems:
        if name in named:
            number = named.index(name)
            styles[name] = {
                "color": theme.colours[number], "marker": _MARKERS[number], "label": name,
                "linewidth": 2.2, "markersize": 4.5, "zorder": 4,
            }  # fmt: skip
        elif name in own:
            styles[name] = {"color": theme.other, "linewidth": 1.0, "zorder": 2}
        else:
            styles[name] = {
                "color": theme.peer, "linewidth": 1.0, "linestyle": (0, (3, 2)), "marker": ".",
                "markersize": 4, "label": name, "zorder": 3,
            }  # fmt: skip
    return styles


def _draw_panel(
    axis: Axes,
    points: Sequence[Point],
    panel: Panel,
    styles: dict[str, dict[str, Any]],
    theme: Theme,
) -> None:
    axis.set(xscale="log", yscale="log", facecolor=theme.page)
    axis.set_title(panel.title, loc="left", fontsize=10.5, weight="bold", pad=6)
    axis.grid(True, which="major", color=theme.grid, linewidth=0.8)
    axis.tick_params(which="both", length=0)
    axis.spines[:].set_visible(False)
    axis.yaxis.set_major_formatter(FuncFormatter(_WITH_UNIT[panel.figure_unit]))
    axis.yaxis.set_major_locator(LogLocator(subs=(1.0, 3.0)))
    axis.xaxis.set_major_formatter(FuncFormatter(_WITH_UNIT[panel.cost_unit]))
    axis.xaxis.set_major_locator(
        FixedLocator(panel.cost_ticks) if panel.cost_ticks else LogLocator(subs=(1.0, 3.0))
    )
    axis.minorticks_off()

    # 0 has no logarithm.
    points = [point for point in points if point.errors.get(panel.figure, 0.0) > 0]
    front = pareto_front(points, panel.figure, panel.cost) if panel.has_front else []
    axis.plot(
        [panel.cost(point) for point in front],
        [point.errors[panel.figure] for point in front],
        color=theme.ink, alpha=0.16, linewidth=10, solid_capstyle="round", zorder=1,
    )  # fmt: skip
    ends = {}
    for system, style in styles.items():
        line = [point for point in points if point.system == system]
        if line:
            axis.plot(
                [panel.cost(point) for point in line],
                [point.errors[panel.figure] for point in line],
                **style,
            )
            ends[system] = (panel.cost(line[-1]), line[-1].errors[panel.figure])
    low, high = axis.get_xlim()
    room = 0.45 if panel.cost_ticks else 0.22  # for names, right of the ends
    axis.set_xlim(low * 0.75, high * (high / low) ** room)
    axis.set_ylim(axis.get_ylim()[0] * 0.75, axis.get_ylim()[1])
    if not panel.cost_ticks:  # which would say the same
        _number_points(axis, front, panel)
    _name_lines(axis, ends, styles, theme)


def _number_points(axis: Axes, front: Sequence[Point], panel: Panel) -> None:
    """Write the number of lights beside points of the front, none over another."""
    numbered: list[np.ndarray[Any, Any]] = []
    for point in front:
        place = (panel.cost(point), point.errors[panel.figure])
        on_page = axis.transData.transform(place)
        if all(np.abs((on_page - other) / _NUMBER_SIZE_PX).max() > 1 for other in numbered):
            numbered.append(on_page)
            axis.annotate(
                str(point.count), place, (-7, -2),
                textcoords="offset points", ha="right", va="top", fontsize=8, zorder=5,
            )  # fmt: skip


def _name_lines(
    axis: Axes,
    ends: dict[str, tuple[float, float]],
    styles: dict[str, dict[str, Any]],
    theme: Theme,
) -> None:
    """Write the names right of their lines' ends, below one another where they would meet."""
    placed: list[tuple[float, float, float]] = []
    in_order = sorted(ends.items(), key=lambda item: -item[1][1])
    for system, end in in_order:
        if "label" not in styles[system]:
            continue
        x, y = axis.transData.transform(end)
        left, right = x + 7, x + 7 + _NAME_SIZE_PX[0] * len(system)
        height = y
        for other_left, other_right, other_height in sorted(placed, key=lambda name: -name[2]):
            meets = left < other_right and other_left < right
            if meets and abs(height - other_height) < _NAME_SIZE_PX[1]:
                height = other_height - _NAME_SIZE_PX[1]
        placed.append((left, right, height))
        axis.annotate(
            system,
            end,
            (7 * 0.72, (height - y) * 0.72),
            textcoords="offset points",
            color=styles[system]["color"],
            weight="bold" if styles[system]["zorder"] == 4 else "normal",
            va="center",
            annotation_clip=False,
            zorder=6,
            bbox={"facecolor": theme.page, "edgecolor": "none", "alpha": 0.8, "pad": 0.6},
        )
