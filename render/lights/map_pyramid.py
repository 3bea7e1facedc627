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
from render.loose_arithmetic import LOOSE

_FLOATS = NDArray[np.float32]
_RGB = tuple[np.float32, np.float32, np.float32]


_LEAST_OCTAVE = 2
_LEAST_ROWS = 1 << _LEAST_OCTAVE


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
def around(
    v: float, width_rad: float
) -> tuple[np.float32, np.float32]:  # pragma: no cover - compiled
    """Return which part of a turn a square about v covers, and log₂ of its width in half turns."""
    turn = min(width_rad / (2 * math.pi * max(math.sin(math.pi * v), 1e-6)), 1.0)
    return np.float32(turn), np.float32(math.log2(max(width_rad, 1e-9) / math.pi))


@njit(nogil=True, fastmath=LOOSE, error_model="numpy")
def mean_over(
    levels: _FLOATS,
    starts: NDArray[np.int64],
    u: np.float32,
    v: np.float32,
    turn: np.float32,
    octave: np.float32,
) -> _RGB:  # pragma: no cover - compiled
    """Return the mean over a square about u, v, all float32, that `around` describes.

    Between two levels of the map: a cell of one is at most as wide, one of the other wider. Beside
    a pole, where cells are narrow, it is the mean of several, two cells apart.
    """
    most = len(starts) - 2
    finest = most + _LEAST_OCTAVE  # log₂ of the rows
    level = min(max(octave + np.float32(finest), np.float32(0)), np.float32(most - 1e-3))
    finer = int(level)
    share = level - np.float32(finer)
    red, green, blue = np.float32(0), np.float32(0), np.float32(0)
    for k in range(2):
        rows = 1 << (finest - finer - k)
        taps = int(turn * np.float32(rows)) + 1
        each = np.float32(1) / np.float32(taps)
        weight = each * (share if k else np.float32(1) - share)
        step = each * turn
        at = u + np.float32(0.5) * (step - turn)
        for _ in range(taps):
            r, g, b = _bilinear(levels, starts[finer + k], rows, at, v)
            red, green, blue = red + weight * r, green + weight * g, blue + weight * b
            at += step
    return red, green, blue


@njit(nogil=True, fastmath=LOOSE, error_model="numpy")
def _bilinear(
    levels: _FLOATS, start: int, rows: int, u: np.float32, v: np.float32
) -> _RGB:  # pragma: no cover - compiled
    """Return a map of 2^k rows at u ≥ −½ and v: around the seam, held at a pole."""
    columns = 2 * rows
    x = u * np.float32(columns) + np.float32(columns - 0.5)  # a turn more, to be above 0
    y = min(max(v * np.float32(rows) - np.float32(0.5), np.float32(0)), np.float32(rows - 1.001))
    column, row = int(x), int(y)
    right, down = x - np.float32(column), y - np.float32(row)
    above, around_seam = start + row * columns, columns - 1
    a = np.uintp(above + (column & around_seam))  # unsigned: never counted from the end
    b = np.uintp(above + ((column + 1) & around_seam))
    c, d = a + np.uintp(columns), b + np.uintp(columns)
    left, up = np.float32(1) - right, np.float32(1) - down
    wa, wb, wc, wd = left * up, right * up, left * down, right * down
    return (
        wa * levels[a, 0] + wb * levels[b, 0] + wc * levels[c, 0] + wd * levels[d, 0],
        wa * levels[a, 1] + wb * levels[b, 1] + wc * levels[c, 1] + wd * levels[d, 1],
        wa * levels[a, 2] + wb * levels[b, 2] + wc * levels[c, 2] + wd * levels[d, 2],
    )
