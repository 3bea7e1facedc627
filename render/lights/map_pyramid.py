"""A map's means over parts of any size: the map halved again and again.

Output : the map on N, N/2, … 4 rows, N the power of two at or below its own, at least 8.
Fails  : a part is taken as a square of latitude and longitude, with soft edges as wide as itself.
"""

import math
from dataclasses import dataclass
from typing import Any

import cv2
import numpy as np
from numba import njit, prange
from numpy.typing import NDArray

from lighting.maps.environment import EnvironmentMap
from lighting.sphere.latlong import solid_angles

_FLOATS = NDArray[np.float32]

_LEAST_ROWS = 4
_CELLS_A_TAP = 1.5


@dataclass(frozen=True, eq=False)
class MapPyramid:
    """Maps of half the rows each.

    Attributes
    ----------
    cells : (cells, 3) float32
        Radiance, one map behind another, each (rows, 2 rows, 3) in a line.
    starts : (levels + 1,) int64
        Where each begins, and where the last one ends.
    """

    cells: _FLOATS
    starts: NDArray[np.int64]

    def coarse(self, most_rows: int) -> _FLOATS:
        """Return the finest map (rows, 2 rows, 3) of at most so many rows."""
        counts = np.diff(self.starts)
        level = int(np.argmax(counts <= 2 * most_rows**2))
        rows = math.isqrt(int(counts[level]) // 2)
        cells: _FLOATS = self.cells[self.starts[level] : self.starts[level + 1]]
        return cells.reshape(rows, 2 * rows, 3)


def map_pyramid(environment: EnvironmentMap) -> MapPyramid:
    """Return the map and its halves; a cell is the mean over its four by solid angle."""
    radiance: NDArray[Any] = environment.radiance
    rows = max(1 << (environment.height.bit_length() - 1), 2 * _LEAST_ROWS)
    if rows != environment.height:
        radiance = _resized(environment, rows)
    counts = [2 * (rows >> level) ** 2 for level in range((rows // _LEAST_ROWS).bit_length())]
    starts = np.cumsum([0, *counts])
    cells = np.empty((starts[-1], 3), np.float32)
    cells[: starts[1]] = radiance.reshape(-1, 3)
    for level in range(1, len(counts)):
        finer, coarser = (cells[starts[k] : starts[k + 1]] for k in (level - 1, level))
        weights = solid_angles(rows >> (level - 1)).astype(np.float32)
        _halve(finer, weights, coarser)
    return MapPyramid(cells, starts)


def _resized(environment: EnvironmentMap, rows: int) -> NDArray[Any]:
    weight: NDArray[Any] = solid_angles(environment.height).astype(np.float32)[:, None]
    light = cv2.resize(
        environment.radiance * weight[..., None], (2 * rows, rows), interpolation=cv2.INTER_AREA
    )
    weight = cv2.resize(weight, (1, rows), interpolation=cv2.INTER_AREA)
    return light / weight.reshape(-1, 1, 1)


@njit(cache=True, nogil=True, parallel=True)
def _halve(
    finer: _FLOATS, weights: _FLOATS, coarser: _FLOATS
) -> None:  # pragma: no cover - compiled
    """Set `coarser` to the means of `finer` (2N², 3), whose rows have weights (N,)."""
    columns = len(weights)  # of the coarser
    for row in prange(columns // 2):
        upper, lower = weights[2 * row], weights[2 * row + 1]
        scale = np.float32(0.5) / (upper + lower)
        above, below = 4 * row * columns, (4 * row + 2) * columns
        for column in range(columns):
            at = row * columns + column
            for c in range(3):
                top = finer[above + 2 * column, c] + finer[above + 2 * column + 1, c]
                bottom = finer[below + 2 * column, c] + finer[below + 2 * column + 1, c]
                coarser[at, c] = scale * (upper * top + lower * bottom)


@njit(nogil=True)
def mean_around(
    levels: _FLOATS, starts: NDArray[np.int64], u: float, v: float, width_rad: float
) -> tuple[float, float, float]:  # pragma: no cover - compiled
    """Return the mean over a square about u, v, of a `MapPyramid`'s map; for kernels."""
    rows = math.sqrt((starts[1] - starts[0]) // 2)
    most = len(starts) - 2
    level = min(max(math.log2(width_rad * rows / math.pi), 0.0), most - 1e-3)
    finer = int(level)
    red, green, blue = 0.0, 0.0, 0.0
    for k in range(finer, finer + 2):
        share = 1 - abs(level - k)
        cells = levels[starts[k] : starts[k + 1]]
        x, y, z = _mean(cells, int(rows) >> k, u, v, width_rad)
        red, green, blue = red + share * x, green + share * y, blue + share * z
    return red, green, blue


@njit(nogil=True)
def _mean(
    cells: _FLOATS, rows: int, u: float, v: float, width_rad: float
) -> tuple[float, float, float]:  # pragma: no cover - compiled
    """Return the mean of a map over a share: beside a pole, where cells are narrow, of several."""
    turn = min(width_rad / (2 * math.pi * max(math.sin(math.pi * v), 1e-6)), 1.0)
    taps = math.ceil(turn * 2 * rows / _CELLS_A_TAP)
    red, green, blue = 0.0, 0.0, 0.0
    for tap in range(taps):
        beside = u + turn * ((tap + 0.5) / taps - 0.5)
        r, g, b = _bilinear(cells, rows, beside, v)
        red, green, blue = red + r, green + g, blue + b
    return red / taps, green / taps, blue / taps


@njit(nogil=True)
def _bilinear(
    cells: _FLOATS, rows: int, u: float, v: float
) -> tuple[float, float, float]:  # pragma: no cover - compiled
    """Return the map (rows × 2 rows, 3) at u, v: around the seam, held at a pole."""
    columns = 2 * rows
    x, y = u * columns - 0.5, min(max(v * rows - 0.5, 0.0), rows - 1.0)
    column, row = math.floor(x), min(int(y), rows - 2)
    right, down = np.float32(x - column), np.float32(y - row)
    left, beside = column % columns, (column + 1) % columns
    a, b = row * columns + left, row * columns + beside
    c, d = a + columns, b + columns
    wa, wb = (1 - right) * (1 - down), right * (1 - down)
    wc, wd = (1 - right) * down, right * down
    return (
        wa * cells[a, 0] + wb * cells[b, 0] + wc * cells[c, 0] + wd * cells[d, 0],
        wa * cells[a, 1] + wb * cells[b, 1] + wc * cells[c, 1] + wd * cells[d, 1],
        wa * cells[a, 2] + wb * cells[b, 2] + wc * cells[c, 2] + wd * cells[d, 2],
    )
