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
         beyond the table are searched one by one, about 1 µs each. 3000 lights take little longer
         than by inverse_cdf.py. The table is made once for each size of map.
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
from functools import cache, lru_cache

import numpy as np
from numba import njit
from numpy.typing import NDArray

from lighting.blocks.block_light import block_colours, block_light
from lighting.blocks.summed_area import cells_per_block
from lighting.maps.environment import LUMINANCE_WEIGHTS, EnvironmentMap
from lighting.sampling.penrose_tiling import points_below, points_in_rectangles
from lighting.sampling.sampled_lights import Array, cone_radius, with_sum
from lighting.sphere.equal_area_chart import directions_of, on_chart, on_sphere

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
"""A Fibonacci number: points in the table, of which a fifth lies on the chart."""


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
    light, integral = block_light(environment.radiance)
    power = float(integral @ LUMINANCE_WEIGHTS)
    if power == 0:
        return np.empty((0, 3)), np.empty((0, 3)), np.empty(0)
    table = _table(environment.height)
    expected = count + 2 * math.sqrt(count) + 2
    while True:
        appears, directions, owners = _kept(light.ravel(), expected / power * _SR_PER_ROOT, table)
        if len(appears) >= count:
            break
        expected *= 1.5
    first = np.argsort(appears, kind="stable")[:count]
    owners = owners[first]
    share = power / count / light.ravel()[owners]  # of its block's light that a light has
    irradiance = block_colours(environment.radiance, owners) * share[:, None]
    radius_rad = cone_radius(table.solid_angle[owners] * share)
    return directions[first], with_sum(irradiance, integral), radius_rad


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
    least : (blocks,) float64
        Demand × solid angle up to which a block has no point.
    turns, heights : (columns + 1,), (rows + 1,) float64
        Borders of the blocks: quarter turns from the left, and cos θ.
    solid_angle : (blocks,) float64
    """

    starts: NDArray[np.int64]
    numbers: NDArray[np.int64]
    places: Array
    least: Array
    turns: Array
    heights: Array
    solid_angle: Array


@lru_cache(maxsize=4)
def _table(height: int) -> _Table:
    """Return the table of the blocks of a map of `height` rows."""
    side = cells_per_block(height)
    rows, columns = -(-height // side), -(-2 * height // side)
    turns = 2 * np.minimum(np.arange(columns + 1) * side, 2 * height) / height
    heights = np.cos(np.pi * np.minimum(np.arange(rows + 1) * side, height) / height)
    numbers, turn, y = _points()
    row = np.minimum(np.searchsorted(-heights, -y, side="right") - 1, rows - 1)
    column = np.minimum(np.searchsorted(turns, turn, side="right") - 1, columns - 1)
    owners = row * columns + column
    order = np.lexsort([numbers, owners])
    least = np.full(rows * columns, _TABLE_LIMIT)
    np.minimum.at(least, owners, numbers + 0.5)
    solid_angle = np.outer(-np.diff(heights), np.diff(turns) * np.pi / 2).ravel()
    return _Table(
        np.searchsorted(owners[order], np.arange(rows * columns + 1)),
        numbers[order],
        directions_of(turn, y)[order],
        least * solid_angle,
        turns,
        heights,
        solid_angle,
    )


@cache
def _points() -> tuple[NDArray[np.int64], Array, Array]:
    """Return numbers, turns and heights (n,) of the points of all tables."""
    numbers, points = points_below(_ROOT, _TABLE_LIMIT, 0.0, 4.0, -1.0, 1.0)
    turn, y, is_on_sphere = on_sphere(points.real, points.imag)
    return numbers[is_on_sphere], turn[is_on_sphere], y[is_on_sphere]


def _kept(light: Array, scale: float, table: _Table) -> tuple[Array, Array, NDArray[np.int64]]:
    """Return when each kept point appears, its direction and its block.

    A point of number v appears at the scale (v + ½) / luminance of its block.
    """
    kept, owners, bright = _kept_in_table(
        light, scale, table.solid_angle, table.least, table.starts, table.numbers, _TABLE_LIMIT
    )
    demand = scale * light[bright] / table.solid_angle[bright]
    more_numbers, more_places, more_owners = _points_in_blocks(demand, table, bright)
    owners = np.concatenate([owners, more_owners])
    numbers = np.concatenate([table.numbers[kept], more_numbers])
    places = np.concatenate([table.places[kept], more_places])
    return (numbers + 0.5) * table.solid_angle[owners] / light[owners], places, owners


def _points_in_blocks(
    demand: Array, table: _Table, blocks: NDArray[np.int64]
) -> tuple[NDArray[np.int64], Array, NDArray[np.int64]]:
    """Return the numbers below the demand (m,) of points in blocks (m,), directions and blocks."""
    row, column = np.divmod(blocks, len(table.turns) - 1)
    left, right = table.turns[column], table.turns[column + 1]
    top, bottom = table.heights[row], table.heights[row + 1]
    t, u = on_chart(np.stack([left, right, left, right]), np.stack([top, top, bottom, bottom]))
    around = np.stack([t.min(axis=0), t.max(axis=0), u.min(axis=0), u.max(axis=0)], axis=1)
    numbers, points, owners = points_in_rectangles(_ROOT, demand, around)
    turn, y, is_in = on_sphere(points.real, points.imag)
    is_in &= (turn >= left[owners]) & (turn < right[owners])
    is_in &= (y <= top[owners]) & (y > bottom[owners])
    return numbers[is_in], directions_of(turn[is_in], y[is_in]), blocks[owners[is_in]]


@njit(cache=True, nogil=True)
def _kept_in_table(light, scale, solid_angle, least, starts, numbers, limit):  # type: ignore[no-untyped-def]
    """Return which points of the table are kept, their blocks, and the blocks beyond the table."""
    kept = [0 for _ in range(0)]
    owners = [0 for _ in range(0)]
    bright = [0 for _ in range(0)]
    for block in range(len(light)):
        if scale * light[block] <= least[block]:
            continue
        demand = scale * light[block] / solid_angle[block]
        if demand > limit:
            bright.append(block)
            continue
        for i in range(starts[block], starts[block + 1]):
            if numbers[i] + 0.5 >= demand:
                break
            kept.append(i)
            owners.append(block)
    return np.array(kept), np.array(owners), np.array(bright)
