"""The diagrams of the report: where corners lie, how far they are off, and how sure the lens is.

Input  : Evidence.    Output : matplotlib figures in the light colours of theme.py.
"""

from collections.abc import Callable
from dataclasses import dataclass

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Rectangle
from matplotlib.ticker import FuncFormatter, LogLocator, MultipleLocator
from numpy.typing import NDArray

from calibration.lens.quality import UNCERTAINTY_LIMIT_RAD
from calibration.report.coverage import RING_RAD, bare_cells, directions
from calibration.report.evidence import Evidence
from calibration.report.theme import LIGHT, SETTINGS

Array = NDArray[np.float64]

_WIDTH_IN = 4.7

_MOST_DRAWN = 2500
"""Corners in a figure; of more, evenly chosen ones are drawn."""

_DRAWN_SHARE = 0.04
"""Of the picture's width: how long a large residual is drawn."""

_BIN_RAD = np.deg2rad(5.0)

_LEAST_IN_BIN = 8

_BEHIND_TEXT = {"facecolor": LIGHT["page"], "edgecolor": "none", "alpha": 0.8, "pad": 1}


@dataclass(frozen=True, eq=False)
class Diagram:
    """A figure with its name, what it is of, and in words what it shows."""

    name: str
    title: str
    caption: str
    figure: Figure


def diagrams(evidence: Evidence) -> list[Diagram]:
    """Return the report's diagrams in their order."""
    drawn: list[Callable[[Evidence], Diagram]] = [
        _coverage,
        _residual_vectors,
        _residual_by_angle,
        _uncertainty,
    ]
    with mpl.rc_context(SETTINGS):
        return [draw(evidence) for draw in drawn]


def _coverage(evidence: Evidence) -> Diagram:
    figure, axis = _picture_axis(evidence)
    bare = bare_cells(evidence)
    for cell in bare:
        outline, _ = evidence.calibration.model.project(cell.outline())
        axis.fill(*outline.T, color=LIGHT["amber"], alpha=0.28, linewidth=0)
    _draw_rings(axis, evidence)
    kept = evidence.kept
    some = _some(kept)
    axis.plot(*evidence.corners.pixels[some].T, "o", ms=1.8, mew=0, color=LIGHT["blue"])
    wrong = evidence.corners.pixels[~kept]
    axis.plot(*wrong.T, "x", ms=4, mew=1, color=LIGHT["red"])
    inner, outer = np.rad2deg(evidence.record.seen_rad)
    caption = (
        f"Corners (dots) lie from {inner:.0f}° to {outer:.1f}° off the axis. "
        f"{_wrong_sentence(len(wrong))}"
        + (
            f"Tinted: where none lies, {len(bare)} of the parts that are looked at. "
            if bare
            else "No part of the picture within is bare. "
        )
        + f"Thin circles are 15° apart; the thick one is the valid angle, "
        f"{np.rad2deg(evidence.calibration.valid_angle_rad):.1f}°." + _chosen_sentence(kept)
    )
    return Diagram("coverage", "Coverage of the picture", caption, figure)


def _residual_vectors(evidence: Evidence) -> Diagram:
    figure, axis = _picture_axis(evidence)
    _draw_rings(axis, evidence)
    some = _some(evidence.kept)
    start, residual = evidence.corners.pixels[some], evidence.residuals_px[some]
    scale = exaggeration(evidence)
    ends = start + scale * residual
    # One line broken by NaN, not one a corner: a tenth of the file.
    sticks = np.stack([start, ends, np.full_like(start, np.nan)], axis=1).reshape(-1, 2)
    axis.plot(*sticks.T, "-", lw=0.8, color=LIGHT["red"])
    axis.plot(*start.T, "o", ms=1.4, mew=0, color=LIGHT["ink"])
    axis.annotate(
        f"{scale}×", (0, 0), (6, 6), xycoords="axes fraction", textcoords="offset points",
        bbox=_BEHIND_TEXT,
    )  # fmt: skip
    caption = (
        f"From each corner as found (dot) to where the lens projects it, exaggerated {scale}×. "
        f"Rms {evidence.record.rms_px:.3f} px. Neighbours that point the same way "
        "tell of something the lens or the board's shape does not say."
        + _chosen_sentence(evidence.kept)
    )
    return Diagram("residuals", "Residual vectors", caption, figure)


def _residual_by_angle(evidence: Evidence) -> Diagram:
    figure, axis = _plain_axis("off the axis", "residual outward, px")
    kept = evidence.kept
    angle, outward = evidence.angle_rad, evidence.outward_px
    sigma = evidence.record.sigma_px
    axis.axhspan(-sigma, sigma, color=LIGHT["blue"], alpha=0.12, linewidth=0)
    some = _some(kept)
    axis.plot(np.rad2deg(angle[some]), outward[some], "o", ms=1.8, mew=0, color=LIGHT["blue"])
    bins = np.floor(angle / _BIN_RAD).astype(int)
    full = [i for i in np.unique(bins[kept]) if np.sum(kept & (bins == i)) >= _LEAST_IN_BIN]
    mean = np.array([outward[kept & (bins == i)].mean() for i in full])
    middle = np.rad2deg((np.array(full) + 0.5) * _BIN_RAD)
    axis.plot(middle, mean, "-o", lw=1.6, ms=3.5, color=LIGHT["red"])
    axis.set_xlim(left=0)
    largest = float(np.abs(mean).max(initial=0.0))
    caption = (
        "How far the lens projects a corner too far out (above 0) or in. Band: one standard "
        f"deviation, {sigma:.3f} px. Line: mean of every 5°, {largest:.3f} px at most; where it "
        "leaves 0 along several degrees, the lens has another profile there."
        + _chosen_sentence(kept)
    )
    return Diagram("residual-by-angle", "Residual against angle", caption, figure)


def _uncertainty(evidence: Evidence) -> Diagram:
    record = evidence.record
    figure, axis = _plain_axis("off the axis", "mrad")
    angle = np.rad2deg(record.angle_rad)
    sigma, split = (mrad(values) for values in (record.sigma_rad, record.split_rad))
    limit = UNCERTAINTY_LIMIT_RAD * 1e3
    valid = np.rad2deg(evidence.calibration.valid_angle_rad)
    axis.axvspan(*np.rad2deg(record.seen_rad), color=LIGHT["blue"], alpha=0.08, linewidth=0)
    axis.axhline(limit, color=LIGHT["amber"], lw=1.2, ls=(0, (4, 2)))
    axis.axvline(valid, color=LIGHT["green"], lw=1.6)
    axis.plot(angle, sigma, "-", lw=2, color=LIGHT["blue"], label="uncertainty")
    axis.plot(angle, split, "-", lw=1.3, color=LIGHT["red"], label="odd less even views")
    axis.set(yscale="log", xlim=(0, angle[-1]))
    near = np.concatenate([sigma, split])[np.tile(angle <= 1.1 * valid, 2)]
    near = near[np.isfinite(near) & (near > 0)]
    axis.set_ylim(0.6 * near.min(initial=limit), 3 * near.max(initial=limit))
    axis.yaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
    axis.yaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
    axis.minorticks_off()
    axis.annotate(
        f"valid to {valid:.1f}°", (valid, 1), (-4, -4), xycoords=("data", "axes fraction"),
        textcoords="offset points", ha="right", va="top", color=LIGHT["green"],
    )  # fmt: skip
    axis.annotate(
        f"limit {limit:g}", (0, limit), (4, 3), textcoords="offset points", color=LIGHT["amber"]
    )
    axis.legend(loc="upper left", fontsize=8)
    unsure = angle[(angle < valid) & ~(sigma <= limit)]
    caption = (
        "Standard deviation of a direction the way it is least sure, and how much lenses from "
        "every other view differ. 1 mrad moves a shadow's edge by 1 mm a metre. Tinted: where "
        "corners were seen. Rays beyond the valid angle are refused: there no corner was seen, or "
        f"the uncertainty exceeds {limit:g} mrad."
        + (
            f" Near the axis it exceeds that too, to {unsure[-1]:.0f}°, where rays are not refused."
            if len(unsure)
            else ""
        )
    )
    return Diagram("uncertainty", "Uncertainty against angle", caption, figure)


def exaggeration(evidence: Evidence) -> int:
    """Return the 1, 2 or 5 times a power of ten by which residuals are drawn longer."""
    lengths = np.hypot(*evidence.residuals_px[evidence.kept].T)
    large = max(float(np.nanpercentile(lengths, 95)), 1e-6) if len(lengths) else 1.0
    wanted = max(_DRAWN_SHARE * evidence.calibration.image_size_px[0] / large, 1.0)
    decade = int(np.floor(np.log10(wanted)))
    return int(max(step * 10**decade for step in (1, 2, 5) if step * 10**decade <= wanted))


def mrad(values_rad: list[float | None]) -> Array:
    """Return values in mrad, NaN where there is none."""
    return np.array([np.nan if value is None else 1e3 * value for value in values_rad])


def _some(kept: NDArray[np.bool_]) -> NDArray[np.int64]:
    places = np.flatnonzero(kept)
    return places[:: max(-(-len(places) // _MOST_DRAWN), 1)]


def _chosen_sentence(kept: NDArray[np.bool_]) -> str:
    step = max(-(-int(kept.sum()) // _MOST_DRAWN), 1)
    return f" One corner of {step} is drawn." if step > 1 else ""


def _wrong_sentence(count: int) -> str:
    return f"Crosses: {count} corners left out as wrong. " if count else ""


def _picture_axis(evidence: Evidence) -> tuple[Figure, Axes]:
    """Return an axis in pixels with the picture's frame."""
    width, height = evidence.calibration.image_size_px
    figure = Figure(figsize=(_WIDTH_IN, _WIDTH_IN * height / width))
    axis = figure.add_axes((0.005, 0.005, 0.99, 0.99))
    axis.set(xlim=(-0.5, width - 0.5), ylim=(height - 0.5, -0.5), aspect="equal")
    axis.axis("off")
    axis.add_patch(
        Rectangle(
            (-0.5, -0.5), width, height, fill=False, edgecolor=LIGHT["muted"], lw=1.2,
            clip_on=False,
        )
    )  # fmt: skip
    return figure, axis


def _plain_axis(x_label: str, y_label: str) -> tuple[Figure, Axes]:
    figure = Figure(figsize=(_WIDTH_IN, 0.72 * _WIDTH_IN))
    axis = figure.add_axes((0.13, 0.14, 0.84, 0.82))
    axis.set(xlabel=x_label, ylabel=y_label)
    axis.xaxis.set_major_locator(MultipleLocator(15))
    axis.xaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}°"))
    axis.tick_params(which="both", length=0)
    axis.spines[["top", "right"]].set_visible(False)
    return figure, axis


def _draw_rings(axis: Axes, evidence: Evidence) -> None:
    """Draw circles of equal angle from the axis, and a thick one at the valid angle."""
    model, valid = evidence.calibration.model, evidence.calibration.valid_angle_rad
    around = np.linspace(0, 2 * np.pi, 181)
    width, height = evidence.calibration.image_size_px
    for number in range(1, int(evidence.record.angle_rad[-1] / RING_RAD) + 1):
        ring, _ = model.project(directions(np.array(RING_RAD * number), around))
        axis.plot(*ring.T, color=LIGHT["grid"], lw=0.8, zorder=1.5)
        x, y = ring[168]
        if number % 2 == 0 and 0 < x < 0.95 * width and 0.05 * height < y < height:
            axis.annotate(
                f"{15 * number}°", (x, y), color=LIGHT["muted"], fontsize=8, ha="center",
                va="center", zorder=4,
                bbox=_BEHIND_TEXT,
            )  # fmt: skip
    edge, _ = model.project(directions(np.array(valid), around))
    axis.plot(*edge.T, color=LIGHT["green"], lw=1.8, zorder=3)
