"""Points of a Penrose tiling, each kept where the map is bright enough for its number.

A fixed sequence of points covers the sphere, and so do those of any smaller number: points are
numbered so that the first of them, however many, are spread evenly (penrose_tiling.py). The
demand for points at a place is k times its luminance; a point is kept if its number is below it.
So a point appears at a certain k, and those `count` that appear first are the lights: as k grows
lights are added, and none ever moves.

Domain : world frame, lat-long grid (CONVENTIONS.md), luminance constant over each block of cells
         (summed_area.py). Unseen cells count as what they hold.
Input  : EnvironmentMap.    Output : directions, irradiance and angular radius of each light.
Cost   : one pass over the map and one over its blocks; blocks so bright that they want points
         beyond the table are searched one by one. The tiling is made once for each size of map.
Fails  : what changes makes lights appear and vanish, at full power
         (tests/limits/test_penrose_popping.py); irradiance is twice as far off as inverse_cdf.py's;
         the chart squeezes the spread of points near ±Y; colour is as coarse as lights are few.

References
----------
.. [1] V. Ostromoukhov, C. Donohue, P.-M. Jodoin, "Fast Hierarchical Importance Sampling with Blue
       Noise Properties", ACM Transactions on Graphics 23(3) (SIGGRAPH), 2004.
"""

import cmath
import math
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numba import njit
from numpy.typing import NDArray

from lighting.environment import EnvironmentMap
from lighting.penrose_tiling import points_below, points_in_rectangles
from lighting.sampled_lights import Array, _cone_radius, _with_sum
from lighting.summed_area import block_sums

_SIDE = 7.773
_ROOT = np.array(
    [
        2 + cmath.rect(1, math.radians(175.52)) * (_SIDE * cmath.rect(along, turn) - 0.721 - 1.342j)
        for along, turn in (
            (math.sin(math.radians(36)), math.pi / 2),
            (-math.cos(math.radians(36)), 0.0),
            (math.cos(math.radians(36)), 0.0),
        )
    ]
)
"""A triangle around the chart, 0 … 4 by −1 … 1: of 1723 that were tried at random, the one whose
first 12 … 1024 points light surfaces most evenly."""
_SR_PER_ROOT = _SIDE**2 * math.sin(math.radians(108)) / 2 * 4 * math.pi / 6
"""The area of the chart is 6."""
_TABLE_LIMIT = 832040.0
"""A Fibonacci number: points in the table, of which a quarter lies on the chart."""


def penrose(environment: EnvironmentMap, count: int) -> tuple[Array, Array, Array]:
    """Return `count` lights of equal luminous power whose irradiances sum to the map's integral.

    Parameters
    ----------
    environment : EnvironmentMap
    count : int
        Number of lights, at least 1. Exactly this many are returned, or none for a map without
        light. Fewer are the first of more.

    Returns
    -------
    directions : (count, 3) float64
        Unit vectors in the world frame, toward the light.
    irradiance : (count, 3) float64
        Radiance × sr. Each light has the chromaticity of its block.
    angular_radius_rad : (count,) float64
        Radius of the cone that is the light's share of the sphere, as in sampled_lights.py.
    """
    blocks = block_sums(environment.radiance)
    rows, columns, _ = blocks.shape
    flat = blocks.reshape(-1, 7)
    power = float(flat[:, 0].sum())
    if power == 0:
        return np.empty((0, 3)), np.empty((0, 3)), np.empty(0)
    table = _table(environment.height, rows, columns)
    luminance = flat[:, 0] / table.solid_angle
    expected = count + 2 * math.sqrt(count) + 2
    while True:
        appears, directions, owners = _kept(luminance, expected / power * _SR_PER_ROOT, table)
        if len(appears) >= count:
            break
        expected *= 1.5
    first = np.argsort(appears, kind="stable")[:count]
    owners = owners[first]
    light = flat[owners]
    each = power / count
    irradiance = light[:, 4:] * (each / light[:, :1])
    radius_rad = _cone_radius(table.solid_angle[owners] * each / light[:, 0])
    return directions[first], _with_sum(irradiance, flat[:, 4:].sum(axis=0)), radius_rad


@dataclass(frozen=True, eq=False)
class _Table:
    """What belongs to a grid of blocks: the tiling's first points by block, and the blocks' shapes.

    Attributes
    ----------
    starts : (blocks + 1,) int64
        Where a block's points begin.
    numbers : (n,) int64
        Ascending in a block, all there are below `_TABLE_LIMIT`.
    places : (n, 3) float64
        Unit directions of the points.
    turns, heights : (columns + 1,), (rows + 1,) float64
        Borders of the blocks: quarter turns from the left, and cos θ.
    solid_angle : (blocks,) float64
    """

    starts: NDArray[np.int64]
    numbers: NDArray[np.int64]
    places: Array
    turns: Array
    heights: Array
    solid_angle: Array


@lru_cache(maxsize=4)
def _table(height: int, rows: int, columns: int) -> _Table:
    """Return the table of a map of `height` rows, parted in blocks of whole cells."""
    cells = -(-height // rows)
    turns = 2 * np.minimum(np.arange(columns + 1) * cells, 2 * height) / height
    heights = np.cos(np.pi * np.minimum(np.arange(rows + 1) * cells, height) / height)
    numbers, points = points_below(_ROOT, _TABLE_LIMIT, 0.0, 4.0, -1.0, 1.0)
    turn, y, is_on_sphere = _on_sphere(points)
    numbers, turn, y = numbers[is_on_sphere], turn[is_on_sphere], y[is_on_sphere]
    row = np.minimum(np.searchsorted(-heights, -y, side="right") - 1, rows - 1)
    column = np.minimum(np.searchsorted(turns, turn, side="right") - 1, columns - 1)
    owners = row * columns + column
    order = np.lexsort([numbers, owners])
    return _Table(
        np.searchsorted(owners[order], np.arange(rows * columns + 1)),
        numbers[order],
        _directions(turn, y)[order],
        turns,
        heights,
        np.outer(-np.diff(heights), np.diff(turns) * np.pi / 2).ravel(),
    )


def _on_sphere(points: NDArray[np.complex128]) -> tuple[Array, Array, NDArray[np.bool_]]:
    """Return quarter turns, cos θ (n,) of points of the chart, and which are on it.

    The chart is HEALPix's, of equal area: straight between |cos θ| = ⅔, four gores beyond.
    """
    t, u = points.real, points.imag
    width = np.minimum(2 * (1 - np.abs(u)), 1)  # of a gore
    quarter = np.floor(t)
    aside = t - quarter - 0.5
    is_in = (t >= 0) & (t < 4) & (width > 0) & (np.abs(aside) < width / 2)
    turn = quarter + 0.5 + aside / np.where(is_in, width, 1)
    y = np.where(np.abs(u) <= 0.5, 4 / 3 * u, np.sign(u) * (1 - width**2 / 3))
    return turn, y, is_in


def _directions(turn: Array, y: Array) -> Array:
    level = np.sqrt((1 - y) * (1 + y))
    phi = np.pi * (1 - turn / 2)
    return np.stack([level * np.sin(phi), y, level * np.cos(phi)], axis=-1)


def _kept(luminance: Array, scale: float, table: _Table) -> tuple[Array, Array, NDArray[np.int64]]:
    """Return when each kept point appears, its direction and its block.

    A point of number v appears at the scale (v + ½) / luminance of its block.
    """
    demand = scale * luminance
    kept, owners = _kept_in_table(demand, table.starts, table.numbers, _TABLE_LIMIT)
    bright = np.flatnonzero(demand > _TABLE_LIMIT)
    more_numbers, more_places, more_owners = _points_in_blocks(demand[bright], table, bright)
    owners = np.concatenate([owners, more_owners])
    numbers = np.concatenate([table.numbers[kept], more_numbers])
    places = np.concatenate([table.places[kept], more_places])
    return (numbers + 0.5) / luminance[owners], places, owners


def _points_in_blocks(
    demand: Array, table: _Table, blocks: NDArray[np.int64]
) -> tuple[NDArray[np.int64], Array, NDArray[np.int64]]:
    """Return the numbers below the demand (m,) of points in blocks (m,), directions and blocks."""
    row, column = np.divmod(blocks, len(table.turns) - 1)
    left, right = table.turns[column], table.turns[column + 1]
    top, bottom = table.heights[row], table.heights[row + 1]
    t, u = _on_chart(np.stack([left, right, left, right]), np.stack([top, top, bottom, bottom]))
    around = np.stack([t.min(axis=0), t.max(axis=0), u.min(axis=0), u.max(axis=0)], axis=1)
    numbers, points, owners = points_in_rectangles(_ROOT, demand, around)
    turn, y, is_in = _on_sphere(points)
    is_in &= (turn >= left[owners]) & (turn < right[owners])
    is_in &= (y <= top[owners]) & (y > bottom[owners])
    return numbers[is_in], _directions(turn[is_in], y[is_in]), blocks[owners[is_in]]


def _on_chart(turn: Array, y: Array) -> tuple[Array, Array]:
    """Return where on the chart quarter turns and cos θ (n,) are; `_on_sphere` undoes it."""
    width = np.minimum(np.sqrt(3 * np.maximum(1 - np.abs(y), 0)), 1)
    middle = np.minimum(np.floor(turn), 3) + 0.5
    t = middle + (turn - middle) * width
    return t, np.where(width == 1, 0.75 * y, np.sign(y) * (1 - width / 2))


@njit(cache=True, nogil=True)
def _kept_in_table(demand, starts, numbers, limit):  # type: ignore[no-untyped-def]
    """Return which points of the table are kept, and their blocks; none of blocks beyond it."""
    kept = [0 for _ in range(0)]
    owners = [0 for _ in range(0)]
    for block in range(len(demand)):
        if demand[block] > limit:
            continue
        for i in range(starts[block], starts[block + 1]):
            if numbers[i] + 0.5 >= demand[block]:
                break
            kept.append(i)
            owners.append(block)
    return np.array(kept), np.array(owners)
