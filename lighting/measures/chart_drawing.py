"""The chart of error against time, for light and for dark pages.

Three panels show a kind of error against time, the fourth against the number of lights. What is
worth most is in colour and has its name at the end of its line, from few lights to many; peers are
grey, fishlight's other methods thin. The broad band joins the points than which nothing is both
cheaper and truer.

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
from lighting.measures.chart import FLICKER, Point, pareto_front
from lighting.reduce import ADAPTIVE

Cost = Callable[[Point], float]


@dataclass(frozen=True)
class _Panel:
    title: str
    figure: str
    cost: Cost
    is_time: bool = True


def _milliseconds(point: Point) -> float:
    return point.ms


def _lights(point: Point) -> float:
    return point.count


PANELS = (
    _Panel("In the open, lights as points", "open, points", _milliseconds),
    _Panel("Behind occluders, lights with their extent", "occluded, discs", _milliseconds),
    _Panel("Flicker behind an occluder, frame to frame", FLICKER, _milliseconds),
    _Panel("Behind occluders, by the number of lights", "occluded, discs", _lights, False),
)
_LEGEND = (
    "Band: nothing else is both cheaper and truer; beside it, the number of lights. "
    "Thin: fishlight's other methods. Grey: not fishlight's."
)
_MARKERS = "osD^v"
_NAME_SIZE_PX = (6.3, 15.0)
"""Width of a letter and height of a line of names, at the 100 dots per inch of a figure."""
_NUMBER_SIZE_PX = (34, 24)
"""Room of a number of up to four digits."""


@dataclass(frozen=True)
class _Theme:
    page: str
    ink: str
    grid: str
    peer: str
    other: str
    colours: tuple[str, ...]


# After the colours of M. Okabe and K. Ito, "Color Universal Design", 2008, which colour-blind eyes
# tell apart; darker on white and lighter on black where they would be faint.
THEMES = {
    "light": _Theme(
        "#ffffff", "#1f2328", "#e4e8ec", "#7d858e", "#a9c4da",
        ("#d55e00", "#0072b2", "#008060", "#b5518e", "#b07800"),
    ),
    "dark": _Theme(
        "#0d1117", "#e6edf3", "#232a33", "#8b949e", "#36556d",
        ("#f0803c", "#4ea8e0", "#2fc39a", "#e39ac6", "#f0b93a"),
    ),
}  # fmt: skip


def draw(
    points: Sequence[Point], own: Sequence[str], about: str, path: Path, theme: str = "light"
) -> None:
    """Write the chart as the suffix of `path` says, .svg or .png.

    Parameters
    ----------
    points : sequence of Point
        Counts of a system ascending.
    own : sequence of str
        Fishlight's systems. The default method and those that are most often on a front are in
        colour.
    about : str
        What was measured and on what, one line below the title.
    path : Path
        Replaced if it exists.
    theme : str
        "light" or "dark".
    """
    colours = THEMES[theme]
    panels = [panel for panel in PANELS if any(panel.figure in point.errors for point in points)]
    styles = _styles(points, own, panels, colours)
    # Fixed ids, so that the same points give the same file.
    settings: dict[Any, Any] = {
        "svg.hashsalt": "fishlight",
        "svg.fonttype": "none",
        "font.family": "DejaVu Sans",
        "font.size": 9,
        "text.color": colours.ink,
        "axes.labelcolor": colours.ink,
        "axes.edgecolor": colours.grid,
        "xtick.color": colours.ink,
        "ytick.color": colours.ink,
    }
    with mpl.rc_context(settings):
        rows = -(-len(panels) // 2)
        figure = Figure(figsize=(10, 1.0 + 4.3 * rows), facecolor=colours.page)
        inches = figure.get_figheight()
        grid = figure.add_gridspec(
            rows, 2, left=0.065, right=0.985, top=1 - 1.2 / inches, bottom=0.35 / inches,
            wspace=0.16, hspace=0.2,
        )  # fmt: skip
        title = "Lights from an environment map: error of the irradiance"
        figure.text(0.012, 1 - 0.33 / inches, title, fontsize=14, weight="bold")
        figure.text(0.012, 1 - 0.56 / inches, about, fontsize=8.5)
        figure.text(0.012, 1 - 0.75 / inches, _LEGEND, fontsize=8.5)
        for number, panel in enumerate(panels):
            axis = figure.add_subplot(grid[number // 2, number % 2])
            _draw_panel(axis, points, panel, styles, colours)
        with replacing(path) as partial:
            metadata = {"Date": None} if path.suffix == ".svg" else None
            figure.savefig(partial, dpi=160, metadata=metadata)


def _styles(
    points: Sequence[Point], own: Sequence[str], panels: Sequence[_Panel], theme: _Theme
) -> dict[str, dict[str, Any]]:
    """Return how each system's line is drawn; what is to be named has a label."""
    systems = list(dict.fromkeys(point.system for point in points))
    on_fronts = Counter(
        point.system for panel in panels for point in pareto_front(points, panel.figure, panel.cost)
    )
    by_worth = sorted(own, key=lambda name: (name != ADAPTIVE, -on_fronts[name]))
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
    panel: _Panel,
    styles: dict[str, dict[str, Any]],
    theme: _Theme,
) -> None:
    axis.set(xscale="log", yscale="log", facecolor=theme.page)
    axis.set_title(panel.title, loc="left", fontsize=10.5, weight="bold", pad=6)
    axis.grid(True, which="major", color=theme.grid, linewidth=0.8)
    axis.tick_params(which="both", length=0)
    axis.spines[:].set_visible(False)
    axis.yaxis.set_major_formatter(FuncFormatter(lambda error, _: f"{100 * error:g} %"))
    axis.yaxis.set_major_locator(LogLocator(subs=(1.0, 3.0)))
    if panel.is_time:
        axis.xaxis.set_major_formatter(FuncFormatter(lambda ms, _: f"{ms:g} ms"))
        axis.xaxis.set_major_locator(LogLocator(subs=(1.0, 3.0)))
    else:
        axis.xaxis.set_major_formatter(FuncFormatter(lambda count, _: f"{count:g}"))
        axis.xaxis.set_major_locator(FixedLocator([4, 16, 64, 256, 1024]))
    axis.minorticks_off()

    # 0 has no logarithm.
    points = [point for point in points if point.errors.get(panel.figure, 0.0) > 0]
    front = pareto_front(points, panel.figure, panel.cost)
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
    room = 0.22 if panel.is_time else 0.45  # for names, right of the ends
    axis.set_xlim(low * 0.75, high * (high / low) ** room)
    axis.set_ylim(axis.get_ylim()[0] * 0.75, axis.get_ylim()[1])
    if panel.is_time:
        _number_points(axis, front, panel)
    _name_lines(axis, ends, styles, theme)


def _number_points(axis: Axes, front: Sequence[Point], panel: _Panel) -> None:
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
    theme: _Theme,
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
