"""The chart of error against time, for light and for dark pages.

A panel for each kind of error, a line for each system from few lights to many, its name at its end.
The broad band joins the points than which nothing is both faster and truer.

Input  : points of chart.py.    Output : SVG and PNG files.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter, LogLocator
from scipy.optimize import isotonic_regression

from capture.output import replacing
from lighting.measures.chart import FLICKER, Point, pareto_front

PANELS = {
    "open, points": "In the open, lights as points",
    FLICKER: "Flicker behind an occluder, frame to frame",
    "occluded, points": "Behind occluders, lights as points",
    "occluded, discs": "Behind occluders, lights as wide as they stand for",
}
_MARKERS = "os^Dvphd<>X*"
_LINES = ("-", (0, (4, 1.5)))
_LABEL_GAP = 0.047
"""Least distance of two names, as a share of the panel's height."""
_NUMBER_SIZE_PX = (30, 13)
"""Room of a number of up to four digits, at the 100 dots per inch of a figure."""


@dataclass(frozen=True)
class _Theme:
    page: str
    ink: str
    grid: str
    peer: str
    colours: tuple[str, ...]


# After the colours of M. Okabe and K. Ito, "Color Universal Design", 2008, which colour-blind eyes
# tell apart; darker on white and lighter on black where they would be faint.
THEMES = {
    "light": _Theme(
        "#ffffff", "#1f2328", "#d8dee4", "#6e7781",
        ("#0072b2", "#d55e00", "#008060", "#b5518e", "#b07800", "#2e9bd6", "#5b3fa8"),
    ),
    "dark": _Theme(
        "#0d1117", "#e6edf3", "#2b323b", "#8b949e",
        ("#4ea8e0", "#f0803c", "#2fc39a", "#e39ac6", "#f0b93a", "#8fd3ff", "#a78bfa"),
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
        The systems to draw in colour, in the order of their colours; the others are grey.
    about : str
        What was measured and on what, one line below the title.
    path : Path
        Replaced if it exists.
    theme : str
        "light" or "dark".
    """
    colours = THEMES[theme]
    panels = [panel for panel in PANELS if any(panel in point.errors for point in points)]
    systems = list(dict.fromkeys(point.system for point in points))
    styles = _styles([name for name in own if name in systems], systems, colours)
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
        figure = Figure(figsize=(15, 0.9 + 5.3 * rows), facecolor=colours.page)
        inches = figure.get_figheight()
        grid = figure.add_gridspec(
            rows, 2, left=0.045, right=0.875, top=1 - 1.1 / inches, bottom=0.55 / inches,
            wspace=0.42, hspace=0.24,
        )  # fmt: skip
        title = "Lights from an environment map: error of the irradiance against time"
        figure.text(0.045, 1 - 0.35 / inches, title, fontsize=15, weight="bold")
        figure.text(0.045, 1 - 0.62 / inches, about, fontsize=9.5)
        for number, panel in enumerate(panels):
            axis = figure.add_subplot(grid[number // 2, number % 2])
            _draw_panel(axis, points, panel, styles, colours)
        with replacing(path) as partial:
            metadata = {"Date": None} if path.suffix == ".svg" else None
            figure.savefig(partial, dpi=110, metadata=metadata)


def _styles(own: list[str], systems: list[str], theme: _Theme) -> dict[str, dict[str, Any]]:
    styles: dict[str, dict[str, Any]] = {}
    for number, name in enumerate(own):
        around, place = divmod(number, len(theme.colours))
        styles[name] = {"color": theme.colours[place], "linestyle": _LINES[around % len(_LINES)]}
    peers = [name for name in systems if name not in styles]
    styles |= {name: {"color": theme.peer, "linestyle": ":"} for name in peers}
    for number, style in enumerate(styles.values()):
        style["marker"] = _MARKERS[number % len(_MARKERS)]
    return styles


def _draw_panel(
    axis: Axes,
    points: Sequence[Point],
    panel: str,
    styles: dict[str, dict[str, Any]],
    theme: _Theme,
) -> None:
    axis.set(xscale="log", yscale="log", facecolor=theme.page)
    axis.set_title(PANELS[panel], loc="left", fontsize=11, weight="bold", pad=6)
    axis.grid(True, which="major", color=theme.grid, linewidth=0.8)
    axis.tick_params(which="both", length=0)
    axis.spines[:].set_visible(False)
    axis.xaxis.set_major_formatter(FuncFormatter(lambda ms, _: f"{ms:g} ms"))
    axis.yaxis.set_major_formatter(FuncFormatter(lambda error, _: f"{100 * error:g} %"))
    for scale in (axis.xaxis, axis.yaxis):
        scale.set_major_locator(LogLocator(subs=(1.0, 3.0)))
    axis.minorticks_off()

    points = [point for point in points if point.errors.get(panel, 0.0) > 0]  # 0 has no logarithm
    front = pareto_front(points, panel)
    axis.plot(
        [point.ms for point in front],
        [point.errors[panel] for point in front],
        color=theme.ink, alpha=0.12, linewidth=9, solid_capstyle="round", zorder=1,
    )  # fmt: skip
    on_front = {point.system for point in front}
    ends = {}
    for system, style in styles.items():
        line = [point for point in points if point.system == system]
        if line:
            axis.plot(
                [point.ms for point in line],
                [point.errors[panel] for point in line],
                linewidth=2.2 if system in on_front else 1.0,
                markersize=5 if system in on_front else 3.5,
                alpha=1.0 if system in on_front else 0.6,
                zorder=3 if system in on_front else 2,
                **style,
            )
            ends[system] = line[-1]
    _hold_limits(axis)
    _number_points(axis, front, panel)
    _name_lines(axis, ends, panel, styles, on_front)


def _hold_limits(axis: Axes) -> None:
    """Settle the limits, which are not known before something asks for them."""
    axis.set_xlim(axis.get_xlim())
    axis.set_ylim(axis.get_ylim())


def _number_points(axis: Axes, front: Sequence[Point], panel: str) -> None:
    """Write the number of lights beside points of the front, none over another."""
    numbered: list[np.ndarray[Any, Any]] = []
    for point in front:
        place = (point.ms, point.errors[panel])
        on_page = axis.transData.transform(place)
        if all(np.abs((on_page - other) / _NUMBER_SIZE_PX).max() > 1 for other in numbered):
            numbered.append(on_page)
            axis.annotate(
                str(point.count), place, (-4, -5),
                textcoords="offset points", ha="right", va="top", fontsize=7.5, zorder=4,
            )  # fmt: skip


def _name_lines(
    axis: Axes,
    ends: dict[str, Point],
    panel: str,
    styles: dict[str, dict[str, Any]],
    on_front: set[str],
) -> None:
    """Write each line's name right of the panel, near the height of its end, none over another."""
    low, high = np.log(axis.get_ylim())
    in_order = sorted(ends.items(), key=lambda item: item[1].errors[panel])
    heights = [(np.log(end.errors[panel]) - low) / (high - low) for _, end in in_order]
    for (system, end), height in zip(in_order, _spread(heights), strict=True):
        axis.annotate(
            system,
            (end.ms, end.errors[panel]),
            (1.035, height),
            textcoords="axes fraction",
            color=styles[system]["color"],
            weight="bold" if system in on_front else "normal",
            va="center",
            annotation_clip=False,
            arrowprops={
                "arrowstyle": "-",
                "color": styles[system]["color"],
                "linewidth": 0.6,
                "alpha": 0.35,
                "relpos": (0, 0.5),
                "shrinkB": 3,
            },
        )


def _spread(heights: Sequence[float]) -> np.ndarray[Any, np.dtype[np.float64]]:
    """Return ascending heights moved the least that puts `_LABEL_GAP` between neighbours."""
    steps = _LABEL_GAP * np.arange(len(heights))
    spread = isotonic_regression(np.asarray(heights) - steps).x
    return np.clip(spread, 0.0, max(1.0 - steps[-1], 0.0)) + steps
