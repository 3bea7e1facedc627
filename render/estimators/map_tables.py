"""The map as estimators read it: its radiance, and directions drawn from it by inverse CDF.

A coordinate picks a row by the rows' light, the other a cell within the row; inside a cell azimuth
and the cosine of the polar angle are even, hence so is solid angle.

Cost   : two passes over the map; two binary searches for each direction.
"""

import math
from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from lighting.maps.environment import EnvironmentMap, luminance
from lighting.sphere.latlong import solid_angles

Floats = NDArray[np.float32]


class MapTables(NamedTuple):
    """A map and a density on it.

    Attributes
    ----------
    radiance : (N, 2N, 3) float32
    density : (N, 2N) float32
        At which directions are drawn from each cell, per sr; all 0 if there is nothing to draw.
    rows : (N + 1,) float64
        Cumulative share of each row, from 0 to 1.
    columns : (N, 2N + 1) float32
        Cumulative share of each cell in its row.
    """

    radiance: Floats
    density: Floats
    rows: NDArray[np.float64]
    columns: Floats


def map_tables(environment: EnvironmentMap, *, is_compensated: bool = False) -> MapTables:
    """Return the tables of a map, drawn from by its luminance.

    With `is_compensated`, by what of the luminance is above its mean over the sphere [1]_: the rest
    is left to another way to draw. Nothing is left of a map that is even.

    References
    ----------
    .. [1] O. Karlík, M. Šik, P. Vévoda, T. Skřivan, J. Křivánek, "MIS Compensation: Optimizing
           Sampling Techniques in Multiple Importance Sampling", SIGGRAPH Asia, 2019.
    """
    brightness = luminance(environment.radiance)
    of_row = solid_angles(environment.height)
    if is_compensated:
        mean = float(of_row @ brightness.sum(axis=1)) / (4 * np.pi)
        brightness = np.maximum(brightness - mean, 0.0)
    power = brightness * of_row[:, None]
    total = power.sum()
    row_power = power.sum(axis=1)
    safe = np.where(row_power > 0, row_power, 1.0)
    columns = np.zeros((len(power), power.shape[1] + 1), np.float32)
    columns[:, 1:] = np.cumsum(power, axis=1) / safe[:, None]
    columns[:, -1] = 1.0
    rows = np.concatenate([[0.0], np.cumsum(row_power) / (total or 1.0)])
    # Density of what float32 draws, not of what it should: the steps of `columns`.
    drawn = np.diff(columns.astype(np.float64), axis=1) * (np.diff(rows) / of_row)[:, None]
    return MapTables(environment.radiance, drawn.astype(np.float32), rows, columns)


@njit(nogil=True)
def cell_of(
    tables: MapTables, x: float, y: float, z: float
) -> tuple[int, int]:  # pragma: no cover - compiled
    """Return row and column of the cell that a direction lies in."""
    height = tables.radiance.shape[0]
    theta = math.atan2(math.sqrt(x * x + z * z), y)
    phi = math.atan2(x, z)
    row = min(int(theta * (height / math.pi)), height - 1)
    return row, int((math.pi - phi) * (height / math.pi)) % (2 * height)


@njit(nogil=True)
def draw_from_map(
    tables: MapTables, u: float, v: float
) -> tuple[int, int, float, float, float]:  # pragma: no cover - compiled
    """Return row and column of a cell, and a direction in it, for (u, v) even in [0, 1)²."""
    height = tables.radiance.shape[0]
    row, down = _found(tables.rows, v)
    column, across = _found(tables.columns[row], u)
    x, y, z = place_in_cell(row, column, height, across, down)
    return row, column, x, y, z


@njit(nogil=True)
def place_in_cell(
    row: int, column: int, height: int, u: float, v: float
) -> tuple[float, float, float]:  # pragma: no cover - compiled
    """Return a direction in a cell, even in solid angle as (u, v) is in [0, 1)²."""
    above, below = math.cos(math.pi * row / height), math.cos(math.pi * (row + 1) / height)
    y = above + v * (below - above)
    level = math.sqrt(max(1 - y * y, 0.0))
    phi = math.pi - math.pi * (column + u) / height
    return level * math.sin(phi), y, level * math.cos(phi)


@njit(nogil=True)
def _found(cumulative: NDArray[np.floating], share: float) -> tuple[int, float]:  # pragma: no cover
    """Return the cell in which a share in [0, 1) lies, and how far into it."""
    low, high = 0, len(cumulative) - 1
    while high - low > 1:
        middle = (low + high) // 2
        if cumulative[middle] <= share:
            low = middle
        else:
            high = middle
    start, end = cumulative[low], cumulative[high]
    return low, (share - start) / (end - start)
