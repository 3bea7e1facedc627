"""Where corners were seen and where not: what to photograph next.

Domain : the camera's directions in rings of 15° about its axis, and in eighths around it. A cell
counts where the picture shows a fair part of it.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from calibration.report.evidence import Evidence

Array = NDArray[np.float64]

RING_RAD = np.deg2rad(15.0)

SECTORS = (
    "right",
    "lower right",
    "bottom",
    "lower left",
    "left",
    "upper left",
    "top",
    "upper right",
)
"""Of the picture, from +x towards +y."""

_LEAST_SHARE = 0.3
"""Of a cell that must lie in the picture, and of a ring that must be reached, for it to count."""

_MANY_VIEWS = 10

_TILTED_RAD = np.deg2rad(20.0)

_TILTED_VIEWS = 3


@dataclass(frozen=True)
class Cell:
    """A part of what the camera sees: the ring from 15° × `ring`, and the eighth `sector` of it.

    The innermost ring is one cell, whose sector is None.
    """

    ring: int
    sector: int | None

    def outline(self) -> Array:
        """Return directions (n, 3) along its edge, from one end of the outer arc on."""
        inner, outer = RING_RAD * self.ring, RING_RAD * (self.ring + 1)
        if self.sector is None:
            return directions(np.array(outer), np.linspace(0, 2 * np.pi, 49))
        around = (self.sector + np.linspace(-0.5, 0.5, 13)) * (2 * np.pi / len(SECTORS))
        return np.concatenate(
            [directions(np.array(outer), around), directions(np.array(inner), around[::-1])]
        )


def directions(angle_rad: Array, azimuth_rad: Array) -> Array:
    """Return unit vectors (..., 3) at angles from the axis, +z, and azimuths from +x towards +y."""
    angle, azimuth = np.broadcast_arrays(angle_rad, azimuth_rad)
    sine = np.sin(angle)
    return np.stack([sine * np.cos(azimuth), sine * np.sin(azimuth), np.cos(angle)], axis=-1)


def bare_cells(evidence: Evidence) -> list[Cell]:
    """Return the cells in the picture without a kept corner, of the rings that were reached."""
    kept = evidence.kept
    last_ring = int(evidence.record.seen_rad[1] / RING_RAD - _LEAST_SHARE)
    ring = np.floor(evidence.angle_rad[kept] / RING_RAD).astype(int)
    sector = np.round(evidence.azimuth_rad[kept] / (2 * np.pi / len(SECTORS))).astype(int)
    sector %= len(SECTORS)
    held = {Cell(r, s if r else None) for r, s in zip(ring.tolist(), sector.tolist(), strict=True)}
    around = range(len(SECTORS))
    cells = [Cell(r, s) for r in range(last_ring + 1) for s in (around if r else [None])]
    return [cell for cell in cells if cell not in held and _shown(cell, evidence)]


def advice(evidence: Evidence) -> list[str]:
    """Return what to photograph next, a sentence each; empty if nothing is missing."""
    record, calibration = evidence.record, evidence.calibration
    sentences = []
    count = len(record.views)
    if count < _MANY_VIEWS:
        sentences.append(
            f"Take {_MANY_VIEWS - count} more pictures of the board or more: {count} were used."
        )
    tilted = sum(evidence.tilt_rad(view) > _TILTED_RAD for view in range(count))
    if tilted < _TILTED_VIEWS:
        sentences.append(
            f"Tilt the board by 30° and more, either way: it was tilted in {tilted} of {count} "
            "pictures, and only tilt tells the focal length from the distance."
        )
    by_ring: dict[int, list[Cell]] = {}
    for cell in bare_cells(evidence):
        by_ring.setdefault(cell.ring, []).append(cell)
    sentences += [_place(ring, cells) for ring, cells in by_ring.items()]

    outer, last = record.seen_rad[1], record.angle_rad[-1]
    valid = calibration.valid_angle_rad
    if valid < outer - np.deg2rad(1.0):
        sentences.append(
            f"Photograph the board more often {np.rad2deg(valid):.0f}° to "
            f"{np.rad2deg(outer):.0f}° off the axis, where directions are not sure enough yet."
        )
    if last > outer + RING_RAD / 3:
        sentences.append(
            f"Bring the board farther out if rays beyond {np.rad2deg(outer):.0f}° are wanted: "
            f"hardly a corner lies there, and the picture may reach {np.rad2deg(last):.0f}°."
        )
    return sentences


def _place(ring: int, cells: list[Cell]) -> str:
    sectors = [SECTORS[cell.sector] for cell in cells if cell.sector is not None]
    if ring == 0:
        return "Hold the board in the middle of the picture: no corner lies within 15° of the axis."
    *first, last = sectors
    where = f"at the {', '.join(first)} and {last}" if first else f"at the {last}"
    if len(sectors) == len(SECTORS):
        where = "all around the middle"
    return (
        f"Hold the board {where} of the picture, {15 * ring}° to {15 * ring + 15}° off the axis: "
        "no corner lies there."
    )


def _shown(cell: Cell, evidence: Evidence) -> bool:
    """Whether a fair part of a cell lies in the picture."""
    steps = (np.arange(6) + 0.5) / 6
    width = 1.0 if cell.sector is not None else float(len(SECTORS))
    around = ((cell.sector or 0) + width * (steps - 0.5)) * (2 * np.pi / len(SECTORS))
    at = directions(RING_RAD * (cell.ring + steps)[:, None], around)
    pixels, seen = evidence.calibration.model.project(at)
    size = np.array(evidence.calibration.image_size_px)
    with np.errstate(invalid="ignore"):
        inside = seen & np.all((pixels >= 0) & (pixels <= size - 1), axis=-1)
    return float(inside.mean()) >= _LEAST_SHARE
