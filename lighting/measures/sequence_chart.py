"""The chart of lights over time, day by day.

Panels, from the top: all light and the strongest key light; how high that stands; how many lights;
the error that is predicted of them. Up to five days are lines over one another. Frames whose light
was clipped, and is a lower bound, are ringed, those that failed are ticks below the first panel; a
line breaks where frames are missing. More days are columns side by side, in which a colour is the
median of a quarter of an hour.

Input  : rows of a sequence table.    Output : an SVG or PNG file.
Fails  : a day is 86,400 s of the recording's own clock; where that does not count from midnight,
nor do the chart's hours.
"""

from collections import Counter, defaultdict
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.axis import Axis
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter, MaxNLocator, MultipleLocator
from numpy.typing import NDArray

from capture.errors import InputError
from capture.output import replacing
from lighting.measures.sequence_table import FrameRow
from lighting.measures.themes import THEMES, Theme, settings_of

_DAY_S = 86_400.0
_MOST_LINES = 5
_COLUMN_STEP_S = 900.0
_GAP = 5.0
"""Median intervals between frames after which a line is broken."""
_HOUR_STEPS_S = (60, 300, 600, 1800, 3600, 7200, 10800, 21600)
_SHORT_S = 300.0

Value = Callable[[FrameRow], float | None]


@dataclass(frozen=True)
class Day:
    """Frames of one recording between two midnights of its clock, in order."""

    recording: str
    number: int
    rows: tuple[FrameRow, ...]

    @property
    def times_s(self) -> NDArray[np.float64]:
        """Times of the frames since midnight."""
        return np.array([row.time_s for row in self.rows]) - self.number * _DAY_S


@dataclass(frozen=True)
class _Panel:
    title: str
    value: Value
    height: float
    is_logarithmic: bool = False
    format: Callable[[float, object], str] | None = None


def _elevation_deg(row: FrameRow) -> float | None:
    return None if row.sun_y is None else float(np.degrees(np.arcsin(np.clip(row.sun_y, -1, 1))))


_PANELS = (
    _Panel(
        "All light, ∫ L dω",
        lambda row: row.total_irradiance,
        1.5,
        is_logarithmic=True,
    ),
    _Panel(
        "Elevation of the strongest key light", _elevation_deg, 1.0, format=lambda y, _: f"{y:g}°"
    ),
    _Panel("Number of lights", lambda row: row.light_count, 0.8),
    _Panel(
        "Predicted error behind occluders",
        lambda row: row.predicted_error,
        0.8,
        format=lambda y, _: f"{100 * y:g} %",
    ),
)


def days_of(rows: Sequence[FrameRow]) -> list[Day]:
    """Return rows, in order of recording and time, cut at the midnights of each recording."""
    days = defaultdict(list)
    for row in rows:
        days[row.recording, int(row.time_s // _DAY_S)].append(row)
    return [Day(*key, tuple(frames)) for key, frames in days.items()]


def draw_sequence(rows: Sequence[FrameRow], path: Path, theme: str = "light") -> None:
    """Write the chart of rows of a sequence table as the suffix of `path` says, .svg or .png.

    Raises
    ------
    InputError
        If no row has lights, or the file cannot be written.
    """
    if all(row.total_irradiance is None for row in rows):
        raise InputError("there are no lights in the table: nothing to draw over time")
    days = days_of(rows)
    colours = THEMES[theme]
    with mpl.rc_context(settings_of(colours)):
        figure = Figure(figsize=(10, 9), facecolor=colours.page)
        figure.text(0.012, 0.968, "Lights over time", fontsize=14, weight="bold")
        figure.text(0.012, 0.945, _about(rows, days), fontsize=8.5)
        axes = figure.subplots(
            len(_PANELS), 1, sharex=True,
            height_ratios=[panel.height for panel in _PANELS],
            gridspec_kw={"left": 0.075, "right": 0.985, "top": 0.88, "bottom": 0.06, "hspace": 0.3},
        )  # fmt: skip
        for axis, panel in zip(axes, _PANELS, strict=True):
            _style(axis, panel, colours)
        if len(days) <= _MOST_LINES:
            _draw_lines(figure, axes, days, colours)
        else:
            _draw_columns(figure, axes, days)
        with replacing(path) as partial:
            metadata = {"Date": None} if path.suffix == ".svg" else None
            figure.savefig(partial, dpi=160, metadata=metadata)


def _about(rows: Sequence[FrameRow], days: Sequence[Day]) -> str:
    failed_count = sum(row.failure is not None for row in rows)
    clipped_count = sum(bool(row.clipped_share) for row in rows)
    recordings = len({day.recording for day in days})
    return (
        f"{len(rows)} frames of {recordings} {'recording' if recordings == 1 else 'recordings'}, "
        f"{len(days)} {'day' if len(days) == 1 else 'days'}; {clipped_count} of them clipped, "
        f"{failed_count} failed"
    )


def _style(axis: Axes, panel: _Panel, theme: Theme) -> None:
    axis.set_facecolor(theme.page)
    axis.set_title(panel.title, loc="left", fontsize=10, weight="bold", pad=5)
    axis.tick_params(which="both", length=0)
    axis.spines[:].set_visible(False)


def _draw_lines(figure: Figure, axes: Sequence[Axes], days: Sequence[Day], theme: Theme) -> None:
    for axis, panel in zip(axes, _PANELS, strict=True):
        axis.grid(True, color=theme.grid, linewidth=0.8)
        if panel.is_logarithmic:
            axis.set_yscale("log")
        else:
            axis.yaxis.set_major_locator(MaxNLocator(4))
        if panel.format is not None:
            axis.yaxis.set_major_formatter(FuncFormatter(panel.format))
        for day, colour in zip(days, theme.colours, strict=False):
            _draw_line(axis, day, panel.value, colour)
    for day, colour in zip(days, theme.colours, strict=False):
        _draw_line(axes[0], day, lambda row: row.sun_power, colour, linestyle=(0, (1, 1.5)))
        _mark_frames(axes[0], day, colour, theme)
    axes[0].set_title(
        f"{_PANELS[0].title}; dotted: the strongest key light; rings: clipped; ticks: failed",
        loc="left", fontsize=10, weight="bold", pad=5,
    )  # fmt: skip
    _name_days(figure, days, theme)
    times_s = np.concatenate([day.times_s for day in days])
    margin_s = 0.02 * max(np.ptp(times_s), 1.0)
    axes[-1].set_xlim(times_s.min() - margin_s, times_s.max() + margin_s)
    if np.ptp(times_s) < _SHORT_S:
        axes[-1].set_xlabel("seconds, by the recording's clock")
    else:
        _show_hours(axes[-1].xaxis, float(np.ptp(times_s)))
        axes[-1].set_xlabel("time of day, by the recording's clock")


def _draw_columns(figure: Figure, axes: Sequence[Axes], days: Sequence[Day]) -> None:
    times_s = [day.times_s for day in days]
    low = min(times.min() for times in times_s) // _COLUMN_STEP_S
    high = max(times.max() for times in times_s) // _COLUMN_STEP_S + 1
    edges_s = _COLUMN_STEP_S * np.arange(low, high + 1)
    figure.subplots_adjust(right=0.955)  # for the numbers beside the scales
    for axis, panel in zip(axes, _PANELS, strict=True):
        columns = np.stack([_column(day, panel.value, edges_s) for day in days], axis=1)
        if not np.isfinite(columns).any():
            continue
        mesh = axis.pcolormesh(
            np.arange(len(days) + 1) - 0.5, edges_s, columns, cmap="viridis", rasterized=True,
            norm="log" if panel.is_logarithmic and np.nanmin(columns) > 0 else "linear",
        )  # fmt: skip
        shown = None if panel.format is None else FuncFormatter(panel.format)
        figure.colorbar(mesh, ax=axis, pad=0.012, fraction=0.04, format=shown).outline.set_visible(
            False
        )
        _show_hours(axis.yaxis, float(edges_s[-1] - edges_s[0]), most_ticks=5)
    axes[-1].xaxis.set_major_locator(MaxNLocator(9, integer=True))
    axes[-1].set_xlabel("day; upward the time of day, by the recording's clock")


def _column(day: Day, value: Value, edges_s: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the median of each step of a day, NaN where there is none."""
    places = np.searchsorted(edges_s, day.times_s, side="right") - 1
    values = _values(day, value)
    found = np.isfinite(values)
    medians = np.full(len(edges_s) - 1, np.nan)
    for place in np.unique(places[found]):
        medians[place] = np.median(values[found & (places == place)])
    return medians


def _values(day: Day, value: Value) -> NDArray[np.float64]:
    return np.array([np.nan if (y := value(row)) is None else float(y) for row in day.rows])


def _draw_line(axis: Axes, day: Day, value: Value, colour: str, linestyle: Any = "-") -> None:
    times_s, values = day.times_s, _values(day, value)
    if len(times_s) > 1:
        steps_s = np.diff(times_s)
        gaps = np.flatnonzero(steps_s > _GAP * np.median(steps_s)) + 1
        times_s, values = np.insert(times_s, gaps, np.nan), np.insert(values, gaps, np.nan)
    # A frame between two without a value has no line, but a point.
    axis.plot(times_s, values, ".", color=colour, markersize=2)
    axis.plot(times_s, values, color=colour, linewidth=1.3, linestyle=linestyle)


def _mark_frames(axis: Axes, day: Day, colour: str, theme: Theme) -> None:
    """Ring what is a lower bound, and put a tick where a frame failed."""
    times_s = day.times_s
    clipped = np.array([bool(row.clipped_share) and bool(row.total_irradiance) for row in day.rows])
    axis.plot(
        times_s[clipped],
        [row.total_irradiance for row in day.rows if row.clipped_share and row.total_irradiance],
        "o", markersize=4, markerfacecolor="none", markeredgecolor=colour, markeredgewidth=0.8,
    )  # fmt: skip
    failed = np.array([row.failure is not None for row in day.rows])
    axis.plot(
        times_s[failed], np.zeros(failed.sum()), "|", color=theme.ink, markersize=9,
        transform=axis.get_xaxis_transform(), clip_on=False,
    )  # fmt: skip


def _name_days(figure: Figure, days: Sequence[Day], theme: Theme) -> None:
    """Write the name of each line in its colour."""
    recordings = Counter(day.recording for day in days)
    x = 0.012
    for day, colour in zip(days, theme.colours, strict=False):
        name = day.recording + (f", day {day.number}" if recordings[day.recording] > 1 else "")
        figure.text(x, 0.921, name, fontsize=8.5, weight="bold", color=colour)
        x += 0.0075 * len(name) + 0.02


def _show_hours(axis: Axis, span_s: float, most_ticks: int = 9) -> None:
    steps_s = [step for step in _HOUR_STEPS_S if span_s / step <= most_ticks]
    axis.set_major_locator(MultipleLocator(steps_s[0]))
    axis.set_major_formatter(
        FuncFormatter(lambda s, _: f"{int(s) // 3600:02d}:{int(s) % 3600 // 60:02d}")
    )
