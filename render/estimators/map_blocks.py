"""Haar's hierarchy of the map's light, and points warped down it to directions.

Level l has 2ˡ × 2ˡ⁺¹ blocks; each holds the light, luminance × solid angle, of four of the level
below: Haar's scaling coefficients, from which its wavelets differ. A point goes down from the top:
its second coordinate picks the upper or the lower pair of blocks by their light, its first the left
or the right of the pair, and each is stretched back to [0, 1) [1]_.

The first levels may be of the product of the light with what surfaces reflect, a Haar series that
ends at `MOST_LEVEL`; from there on it is the map's alone.

References
----------
.. [1] P. Clarberg, W. Jarosz, T. Akenine-Möller, H. W. Jensen, "Wavelet Importance Sampling:
       Efficiently Evaluating Products of Complex Functions", SIGGRAPH, 2005.
"""

import math
from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from lighting.maps.environment import EnvironmentMap, luminance
from lighting.sphere.latlong import grid_to_direction, solid_angles
from render.estimators.map_tables import place_in_cell

Floats = NDArray[np.float32]

MOST_LEVEL = 4
"""16 × 32 blocks of 11°, in which what surfaces reflect is taken as constant."""


class MapBlocks(NamedTuple):
    """A map as a hierarchy.

    Attributes
    ----------
    light : (J,) float64
        All levels from the top, level l from `start(l)` on, row by row.
    levels : int
        The last, whose blocks are cells.
    level : int
        The one at which what surfaces reflect is looked at, at most `MOST_LEVEL`.
    directions : (B, 3) float32
        Of the middle of each of its blocks.
    radius_rad : float
        From their middle to their corner, at the equator.
    radiance : (N, 2N, 3) float32
    """

    light: NDArray[np.float64]
    levels: int
    level: int
    directions: Floats
    radius_rad: float
    radiance: Floats


def map_blocks(environment: EnvironmentMap) -> MapBlocks:
    """Return the hierarchy of a map."""
    height = environment.height
    levels = (height - 1).bit_length()
    rows = 1 << levels
    light = np.zeros((rows, 2 * rows))
    light[:height, : 2 * height] = luminance(environment.radiance) * solid_angles(height)[:, None]
    pyramid = [light]
    while len(pyramid[0]) > 1:
        below = pyramid[0]
        pyramid.insert(0, below.reshape(len(below) // 2, 2, len(below), 2).sum(axis=(1, 3)))
    level = min(levels, MOST_LEVEL)
    wide = rows >> level  # cells along the side of a block; those at the end may lie off the map
    row, column = np.mgrid[: 1 << level, : 2 << level] * wide
    last = np.minimum(np.array([row, column]) + wide, np.array([height, 2 * height])[:, None, None])
    middle = np.stack([column + last[1], row + last[0]], axis=-1) / 2 - 0.5
    return MapBlocks(
        np.concatenate([each.ravel() for each in pyramid]),
        levels,
        level,
        grid_to_direction(middle, height).reshape(-1, 3).astype(np.float32),
        math.pi / height * wide / math.sqrt(2),
        environment.radiance,
    )


@njit(nogil=True)
def start(level: int) -> int:  # pragma: no cover - compiled
    """Return where a level begins: 2 (1 + 4 + … ) blocks come before it."""
    return 2 * ((1 << 2 * level) - 1) // 3


@njit(nogil=True)
def add_up_levels(product: NDArray[np.floating], level: int) -> None:  # pragma: no cover
    """Set the levels above `level` of a hierarchy (J, …), each to the sums of the one below."""
    for upper in range(level - 1, -1, -1):
        width = 2 << upper
        for row in range(1 << upper):
            for column in range(width):
                below = start(upper + 1) + 2 * row * 2 * width + 2 * column
                product[start(upper) + row * width + column] = (
                    product[below]
                    + product[below + 1]
                    + product[below + 2 * width]
                    + product[below + 2 * width + 1]
                )


@njit(nogil=True, error_model="numpy")
def warp(
    blocks: MapBlocks, product: NDArray[np.floating], u: float, v: float
) -> tuple[int, int, int, float, float, float]:  # pragma: no cover - compiled
    """Return block, row and column of the cell, and direction of a point (u, v) in [0, 1)².

    `product` (J,) holds levels 0 to `blocks.level`, not all 0. The point's density is that of the
    product over its blocks, of the map's light within a block, and even in a cell.
    """
    right = u * (product[0] + product[1]) >= product[0]
    u = _rest(u, product[0], product[1], right)
    row, column, block = 0, int(right), 0
    for level in range(1, blocks.levels + 1):
        width = 2 << level
        row, column = 2 * row, 2 * column
        above = start(level) + row * width + column
        is_product = level <= blocks.level
        a, b, c, d = (
            _entry(blocks, product, is_product, above),
            _entry(blocks, product, is_product, above + 1),
            _entry(blocks, product, is_product, above + width),
            _entry(blocks, product, is_product, above + width + 1),
        )
        lower = v * (a + b + c + d) >= a + b
        v = _rest(v, a + b, c + d, lower)
        left, other = (c, d) if lower else (a, b)
        right = u * (left + other) >= left
        u = _rest(u, left, other, right)
        row, column = row + int(lower), column + int(right)
        if level == blocks.level:
            block = row * width + column
    x, y, z = place_in_cell(row, column, blocks.radiance.shape[0], u, v)
    return block, row, column, x, y, z


@njit(nogil=True)
def _entry(
    blocks: MapBlocks, product: NDArray[np.floating], is_product: bool, at: int
) -> float:  # pragma: no cover - compiled
    return np.float64(product[at]) if is_product else blocks.light[at]


@njit(nogil=True, error_model="numpy")
def _rest(share: float, first: float, second: float, is_second: bool) -> float:  # pragma: no cover
    """Return how far into its part a share of two parts lies, in [0, 1)."""
    whole = share * (first + second)
    rest = (whole - first) / second if is_second else whole / first
    return min(max(rest, 0.0), 1 - 2.0**-53)
