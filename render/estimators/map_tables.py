"""The map as estimators read it: its radiance, and directions drawn from it by inverse CDF.

A coordinate picks a row by the rows' light, the other a cell within the row; inside a cell azimuth
and the cosine of the polar angle are even, hence so is solid angle. Where to begin to look for a
share is told by a guide [1]_ of as many entries as there are cells: one step is taken on average.

Cost   : two passes over the map; a few places of memory for each direction.

References
----------
.. [1] H.-C. Chen, Y. Asau, "On Generating Random Variates from an Empirical Distribution", AIIE
       Transactions 6(2), 1974: the indexed search.
"""

import math
from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from lighting.maps.environment import EnvironmentMap, luminance
from lighting.sphere.latlong import solid_angles
from render.reference.angles import angle_of, sine_cosine

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
    row_guide : (N,) int32
        Row in which the share j / N of all lies.
    column_guide : (N, 2N) int32
        Cell in which the share j / 2N of its row lies.
    """

    radiance: Floats
    density: Floats
    rows: NDArray[np.float64]
    columns: Floats
    row_guide: NDArray[np.int32]
    column_guide: NDArray[np.int32]


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
    row_power = power.sum(axis=1)
    summed = np.cumsum(row_power)
    safe = np.where(row_power > 0, row_power, 1.0)
    columns = np.zeros((len(power), power.shape[1] + 1), np.float32)
    columns[:, 1:] = np.cumsum(power, axis=1) / safe[:, None]
    columns[:, -1] = 1.0
    rows = np.concatenate([[0.0], summed / (summed[-1] or 1.0)])
    # Density of what float32 draws, not of what it should: the steps of `columns`.
    drawn = np.diff(columns.astype(np.float64), axis=1) * (np.diff(rows) / of_row)[:, None]
    # One line of memory holds all that is known of a cell.
    cells = np.concatenate([environment.radiance, drawn[..., None]], axis=-1, dtype=np.float32)
    return MapTables(
        cells[..., :3],
        cells[..., 3],
        rows,
        columns,
        _guide(rows),
        np.stack([_guide(each) for each in columns]),
    )


def _guide(cumulative: NDArray[np.floating]) -> NDArray[np.int32]:
    count = len(cumulative) - 1
    found = np.searchsorted(cumulative, np.arange(count) / count, side="right") - 1
    return np.minimum(found, count - 1).astype(np.int32)


@njit(nogil=True, forceinline=True)
def cell_of(
    tables: MapTables, x: float, y: float, z: float
) -> tuple[int, int]:  # pragma: no cover - compiled
    """Return row and column of the cell that a direction lies in."""
    height = tables.radiance.shape[0]
    theta = angle_of(math.sqrt(x * x + z * z), y)
    phi = angle_of(x, z)
    row = min(int(theta * (height / math.pi)), height - 1)
    return row, int((math.pi - phi) * (height / math.pi)) % (2 * height)


@njit(nogil=True, forceinline=True)
def draw_from_map(
    tables: MapTables, u: float, v: float
) -> tuple[int, int, float, float, float]:  # pragma: no cover - compiled
    """Return row and column of a cell, and a direction in it, for (u, v) even in [0, 1)²."""
    height = tables.radiance.shape[0]
    row, down = _found(tables.rows, tables.row_guide, v)
    column, across = _found(tables.columns[row], tables.column_guide[row], u)
    x, y, z = place_in_cell(row, column, height, across, down)
    return row, column, x, y, z


@njit(nogil=True, forceinline=True)
def place_in_cell(
    row: int, column: int, height: int, u: float, v: float
) -> tuple[float, float, float]:  # pragma: no cover - compiled
    """Return a direction in a cell, even in solid angle as (u, v) is in [0, 1)²."""
    half = 0.5 * math.pi / height
    sine, cosine = sine_cosine((row + 0.5) * (0.5 / height))
    # (1 − v) cos θ₀ + v cos θ₁ of the row's edges.
    y = cosine * math.cos(half) + (1 - 2 * v) * sine * math.sin(half)
    level = math.sqrt(max(1 - y * y, 0.0))
    sine, cosine = sine_cosine(0.5 - (column + u) * (0.5 / height))
    return level * sine, y, level * cosine


@njit(nogil=True, forceinline=True)
def _found(
    cumulative: NDArray[np.floating], guide: NDArray[np.int32], share: float
) -> tuple[int, float]:  # pragma: no cover - compiled
    """Return the cell in which a share in [0, 1) lies, and how far into it."""
    last = len(guide) - 1
    at = guide[int(share * len(guide))]
    while at < last and cumulative[at + 1] <= share:
        at += 1
    start, end = cumulative[at], cumulative[at + 1]
    return at, (share - start) / (end - start)
