"""Fixed cells of equal solid angle: the directions that visibility is baked for.

A hemisphere is the square [−1, 1]² bent by the concentric map, which keeps areas: its n × n squares
are cells of 2π / n² sr, none longer than about twice its width. A scene on a ground has the upper
hemisphere's cells; one without has those of the lower one after them, its mirror image.

Domain : world frame, +Y up.

References
----------
.. [1] P. Shirley, K. Chiu, "A Low Distortion Map Between Disk and Square", J. Graphics Tools 2(3),
       1997.
"""

from dataclasses import dataclass
from functools import cache

import numpy as np
from numba import njit
from numpy.typing import NDArray

from capture.arrays import read_only
from lighting.sphere.latlong import grid_to_direction, solid_angles

Array = NDArray[np.float64]

SIDE = 16
"""Cells along the side of a hemisphere's square."""

SUBDIVISIONS = 8
"""Points along the side of a cell where a light's disc is sampled."""


@dataclass(frozen=True, eq=False)
class DirectionCells:
    """Cells with points spread evenly over each.

    Attributes
    ----------
    points : (D, S, 3) float64
        Unit directions; S points for each of the D cells.
    solid_angle_sr : float
        Of one cell.
    """

    points: Array
    solid_angle_sr: float

    @property
    def count(self) -> int:
        """D."""
        return len(self.points)

    @property
    def width_rad(self) -> float:
        """Diameter of a cone with a cell's solid angle."""
        return float(4 * np.arcsin(np.sqrt(self.solid_angle_sr / (4 * np.pi))))


@cache
def direction_cells(
    *, upper_only: bool, subdivisions: int = SUBDIVISIONS, side: int = SIDE
) -> DirectionCells:
    """Return the cells of the upper hemisphere, or of the whole sphere."""
    fine = side * subdivisions
    across = (np.arange(fine) + 0.5) * (2 / fine) - 1
    upper = _hemisphere(*np.meshgrid(across, across, indexing="ij"))
    split = upper.reshape(side, subdivisions, side, subdivisions, 3).swapaxes(1, 2)
    points = split.reshape(side * side, subdivisions**2, 3)
    if not upper_only:
        points = np.concatenate([points, points * [1.0, -1.0, 1.0]])
    return DirectionCells(
        read_only("points", points, np.float64, (None, None, 3)), 2 * np.pi / side**2
    )


def _hemisphere(a: Array, b: Array) -> Array:
    """Return the upper hemisphere's directions (..., 3) at points of the square."""
    is_wide = np.abs(a) > np.abs(b)
    radius = np.where(is_wide, a, b)
    ratio = np.where(is_wide, b, a) / np.where(radius == 0, 1.0, radius)
    angle = np.where(is_wide, np.pi / 4 * ratio, np.pi / 2 - np.pi / 4 * ratio)
    level = radius * np.sqrt(2 - radius * radius)
    return np.stack([level * np.sin(angle), 1 - radius * radius, level * np.cos(angle)], axis=-1)


def cell_of(directions: Array, *, upper_only: bool, side: int = SIDE) -> NDArray[np.int64]:
    """Return the cell that each of directions (..., 3) lies in; −1 where there is none."""
    x, y, z = np.moveaxis(directions, -1, 0)
    radius = np.sqrt(np.maximum(1 - np.abs(y), 0.0))
    angle = np.arctan2(x, z)
    turned = (angle + np.pi / 4) % np.pi - np.pi / 4  # −π/4 … 3π/4: the opposite side is its mirror
    sign = np.where(np.abs((angle - turned) / np.pi) % 2 > 0.5, -1.0, 1.0)
    is_wide = turned < np.pi / 4
    a = sign * radius * np.where(is_wide, 1.0, 2 - turned * (4 / np.pi))
    b = sign * radius * np.where(is_wide, turned * (4 / np.pi), 1.0)
    row, column = (np.clip((each + 1) * (side / 2), 0, side - 1).astype(int) for each in (a, b))
    cell = row * side + column + np.where(y < 0, side * side, 0)
    return np.where((y < 0) & upper_only, -1, cell)


def spread_over_cells(
    cells: DirectionCells, directions: Array, irradiance: Array, radius_rad: Array
) -> Array:
    """Return ∫L dω of each cell, (D, 3), from lights: each spread over the points of its disc.

    A surface that faces a light receives from its cells what it receives from its disc.

    A cell's light comes from all of it, which spreads a disc by as much as a convolution with the
    cell: so the disc is drawn narrower by that, yet no narrower than a cell, so that it moves over
    the cells without steps.

    Parameters
    ----------
    directions, irradiance, radius_rad : (K, 3), (K, 3), (K,) float64
        As in `LightSet`. A light none of whose disc is in a cell is lost.
    """
    cell = 0.5 * cells.width_rad
    radius = np.sqrt(np.maximum(radius_rad**2 - cell**2, cell**2))
    soft = cell / np.sqrt(cells.points.shape[1])
    inner, outer = np.cos(radius - soft), np.cos(np.minimum(radius + soft, np.pi))
    middles, extent_rad = _middles(cells)
    near = np.cos(np.minimum(radius + soft + extent_rad, np.pi))
    per_cell = _shares(directions, cells.points, middles, inner, outer, near)
    received = (per_cell * (directions @ cells.points.mean(axis=1).T)).sum(axis=1)
    facing = (1 + np.cos(radius_rad)) / 2
    gain = np.divide(facing, received, out=np.zeros_like(facing), where=received > 0)
    return per_cell.T @ (gain[:, None] * irradiance)


@cache
def _middles(cells: DirectionCells) -> tuple[Array, float]:
    """Return the middles of cells, (D, 3), and the farthest from them that a point is."""
    middles = cells.points.mean(axis=1)
    middles /= np.linalg.norm(middles, axis=1, keepdims=True)
    cosine = np.einsum("dsc,dc->ds", cells.points, middles).min()
    return middles, float(np.arccos(cosine))


@njit(cache=True, nogil=True)
def _shares(
    directions: Array, points: Array, middles: Array, inner: Array, outer: Array, near: Array
) -> Array:  # pragma: no cover - compiled
    """Return which share of each disc lies in each cell, (K, D): its edge is soft."""
    shares = np.zeros((len(directions), len(points)))
    for k in range(len(directions)):
        x, y, z = directions[k]
        total = 0.0
        for cell in range(len(points)):
            if x * middles[cell, 0] + y * middles[cell, 1] + z * middles[cell, 2] < near[k]:
                continue
            for s in range(points.shape[1]):
                point = points[cell, s]
                cosine = x * point[0] + y * point[1] + z * point[2]
                share = (cosine - outer[k]) / (inner[k] - outer[k])
                shares[k, cell] += min(max(share, 0.0), 1.0)
            total += shares[k, cell]
        if total > 0:
            shares[k] /= total
    return shares


def map_over_cells(radiance: NDArray[np.floating], *, upper_only: bool) -> Array:
    """Return ∫L dω of each cell, (D, 3), of a lat-long map (N, 2N, 3)."""
    cell, weight, count = _cells_of_map(len(radiance), upper_only=upper_only)
    light = radiance.reshape(-1, 3) * weight
    # What has no cell goes to one more at the end.
    sums = [np.bincount(cell, light[:, c], count + 1)[:count] for c in range(3)]
    return np.stack(sums, axis=1)


@cache
def _cells_of_map(rows: int, *, upper_only: bool) -> tuple[NDArray[np.int64], Array, int]:
    row, column = np.divmod(np.arange(2 * rows * rows), 2 * rows)
    directions = grid_to_direction(np.stack([column, row], axis=-1), rows)
    count = direction_cells(upper_only=upper_only).count
    cell = cell_of(directions, upper_only=upper_only)
    return np.where(cell < 0, count, cell), solid_angles(rows)[row][:, None], count


def disc_points(direction: Array, radius_rad: float, count: int) -> Array:
    """Return `count` directions spread evenly over a disc, (count, 3): a golden spiral."""
    step = np.arange(count) + 0.5
    height = 1 - (1 - np.cos(radius_rad)) * step / count
    turn = step * (np.pi * (3 - np.sqrt(5)))
    level = np.sqrt(np.maximum(1 - height * height, 0.0))
    side = np.cross(direction, np.eye(3)[np.argmin(np.abs(direction))])
    side /= np.linalg.norm(side)
    across = np.cross(direction, side)
    return (
        height[:, None] * direction
        + (level * np.cos(turn))[:, None] * side
        + (level * np.sin(turn))[:, None] * across
    )
