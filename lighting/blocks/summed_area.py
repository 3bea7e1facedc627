"""Light, mean direction and spread of any rectangle of a lat-long map, from four look-ups.

Domain : world frame, lat-long grid (CONVENTIONS.md), radiance constant over each cell of the map.
Input  : radiance.    Output : sums over blocks of cells, and their summed-area tables.
Maps of more than 256 rows are first summed over blocks of cells. That loses no energy and moves no
centroid; it only limits where a rectangle may begin.
Cost   : one pass over the map, one over the blocks.
Fails  : a difference of table entries carries their rounding error, about 1e-16 of the light above
         and to the left. Rectangles that are that much darker than the rest have a wrong variance,
         which is why what a light emits is summed anew from its blocks, by `cell_sums`.

References
----------
.. [1] F. C. Crow, "Summed-area tables for texture mapping", SIGGRAPH, 1984.
"""

from functools import lru_cache

import numpy as np
from numba import njit, prange
from numpy.typing import NDArray

from lighting.maps.environment import LUMINANCE_WEIGHTS
from lighting.sphere.latlong import solid_angles

Array = NDArray[np.float64]

MOST_ROWS = 256
"""Rows of blocks. On 33 captured maps, up to 256 lights are as good with 128 as with 512, which
take three times as long. With 1024 lights, irradiance is as good with 256 as with 512, but 12 %
worse with 128; behind occluders, points are 20 % worse with 256 and 70 % with 128 than with 512."""


def block_sums(radiance: NDArray[np.float32], most_rows: int = MOST_ROWS) -> Array:
    """Return integrals over blocks of cells: of Y, of Y d, and of radiance.

    Parameters
    ----------
    radiance : (N, 2N, 3) float32
        Linear Rec.709; Y is its luminance, d the unit direction in the world frame.
    most_rows : int
        Rows of blocks, at most.

    Returns
    -------
    (rows, columns, 7) float64
        Per block ∫Y dω, ∫Y d dω (3), ∫L dω (3). The integral of d over a cell is exact, not its
        centre times its solid angle, so cells at a pole are as good as any.
    """
    height, width, _ = radiance.shape
    side = cells_per_block(height, most_rows)
    # numpy asks for huge pages, numba does not, and its fresh pages take as long as all the sums.
    sums = np.zeros((-(-height // side), -(-width // side), 7))
    # As plain rows of numbers, the distance of which the compiler knows: a quarter faster.
    rows = radiance.reshape(height, -1)
    _add_cells(rows, side, *_cell_integrals(height), sums)
    return sums


def cells_per_block(height: int, most_rows: int = MOST_ROWS) -> int:
    """Return the cells along a side of a block of an N × 2N map; at its end a block has fewer."""
    return -(-height // most_rows)


def summed_area_tables(blocks: Array) -> tuple[Array, NDArray[np.int64]]:
    """Return tables of light and of lit blocks; entry (r, c) sums over rows < r and columns < c.

    Parameters
    ----------
    blocks : (rows, columns, 7) float64
        From `block_sums`.

    Returns
    -------
    moments : (rows + 1, columns + 1, 4) float64
        ∫Y dω and ∫Y d dω.
    lit : (rows + 1, columns + 1) int64
        Number of blocks with light. Integers, so that whether a rectangle is dark is never a
        matter of rounding.
    """
    rows, columns, _ = blocks.shape
    moments = np.zeros((rows + 1, columns + 1, 4))
    lit = np.zeros((rows + 1, columns + 1), np.int64)
    _fill_tables(blocks, moments, lit)
    return moments, lit


@njit(cache=True, nogil=True)
def rectangle_moments(moments, top, bottom, left, right):  # type: ignore[no-untyped-def]
    """Return (∫Y dω, ∫Y d dω) of blocks in rows [top, bottom) and columns [left, right)."""
    return (
        moments[bottom, right, 0] - moments[top, right, 0]
        - (moments[bottom, left, 0] - moments[top, left, 0]),
        moments[bottom, right, 1] - moments[top, right, 1]
        - (moments[bottom, left, 1] - moments[top, left, 1]),
        moments[bottom, right, 2] - moments[top, right, 2]
        - (moments[bottom, left, 2] - moments[top, left, 2]),
        moments[bottom, right, 3] - moments[top, right, 3]
        - (moments[bottom, left, 3] - moments[top, left, 3]),
    )  # fmt: skip


@njit(cache=True, nogil=True)
def rectangle_lit(lit, top, bottom, left, right):  # type: ignore[no-untyped-def]
    """Return the number of blocks with light in rows [top, bottom) and columns [left, right)."""
    return lit[bottom, right] - lit[top, right] - lit[bottom, left] + lit[top, left]


@njit(cache=True, nogil=True)
def variance(power, x, y, z):  # type: ignore[no-untyped-def]
    """Return ∫ Y |d − m|² dω = S0 − |S1|²/S0 about the mean m = S1/S0, from S0 and S1 = (x, y, z).

    Directions are unit vectors, so this is exact: no seam, no pole. 0 where rounding has left
    nothing to tell.
    """
    if power <= 0.0:
        return 0.0
    return max(power - (x * x + y * y + z * z) / power, 0.0)


@njit(cache=True, nogil=True)
def cell_sums(blocks, cells):  # type: ignore[no-untyped-def]
    """Return the sums (n, 7) of blocks over cells (n, 4) of (top, bottom, left, right)."""
    sums = np.empty((len(cells), 7))
    for i in range(len(cells)):
        top, bottom, left, right = cells[i]
        power = x = y = z = red = green = blue = 0.0
        for r in range(top, bottom):
            for c in range(left, right):
                power += blocks[r, c, 0]
                x += blocks[r, c, 1]
                y += blocks[r, c, 2]
                z += blocks[r, c, 3]
                red += blocks[r, c, 4]
                green += blocks[r, c, 5]
                blue += blocks[r, c, 6]
        sums[i] = (power, x, y, z, red, green, blue)
    return sums


@njit(cache=True, nogil=True)
def label_sums(blocks, labels, number):  # type: ignore[no-untyped-def]
    """Return the sums (number, 7) of blocks (n, 7) that have the same label (n,), from 0."""
    sums = np.zeros((number, 7))
    for i in range(len(labels)):
        for k in range(7):
            sums[labels[i], k] += blocks[i, k]
    return sums


@lru_cache(maxsize=8)
def _cell_integrals(height: int) -> tuple[Array, Array]:
    """Return factors of ∫dω and ∫d dω over a cell: rows (N, 3) and columns (2N, 2).

    With d = (sin θ sin φ, cos θ, sin θ cos φ) and dω = sin θ dθ dφ, a row gives ∫∫sin θ dθ dφ,
    ∫sin²θ dθ and ∫∫sin θ cos θ dθ dφ, a column ∫sin φ dφ and ∫cos φ dφ.
    """
    step = np.pi / height  # of θ and of φ
    theta = step * (np.arange(height) + 0.5)
    phi = np.pi - step * (np.arange(2 * height) + 0.5)
    level = (step - np.cos(2 * theta) * np.sin(step)) / 2
    upward = step * np.sin(2 * theta) * np.sin(step) / 2
    rows = np.stack([solid_angles(height), level, upward], axis=-1)
    columns = 2 * np.sin(step / 2) * np.stack([np.sin(phi), np.cos(phi)], axis=-1)
    return rows, columns


@njit(cache=True, nogil=True, parallel=True, fastmath={"contract"})
def _add_cells(radiance, side, row_factors, column_factors, sums):  # type: ignore[no-untyped-def]
    """Add each cell of radiance (N, 6N) to the sums (rows, columns, 7) of its block.

    A thread has whole rows of blocks, so that any number of threads gives the same bits.
    """
    red, green, blue = LUMINANCE_WEIGHTS
    height, width = len(radiance), len(column_factors)
    for block_row in prange(len(sums)):
        line = sums[block_row]
        top = block_row * side
        for row in range(top, min(top + side, height)):
            solid_angle, level, upward = row_factors[row]
            for k in range(len(line)):
                r = g = b = x = z = 0.0
                first = k * side
                for column in range(first, min(first + side, width)):
                    # float64 before any product: single cells may be as bright as float32 goes.
                    cell_r = np.float64(radiance[row, 3 * column])
                    cell_g = np.float64(radiance[row, 3 * column + 1])
                    cell_b = np.float64(radiance[row, 3 * column + 2])
                    power = red * cell_r + green * cell_g + blue * cell_b
                    r += cell_r
                    g += cell_g
                    b += cell_b
                    x += power * column_factors[column, 0]
                    z += power * column_factors[column, 1]
                power = red * r + green * g + blue * b
                line[k, 0] += power * solid_angle
                line[k, 1] += x * level
                line[k, 2] += power * upward
                line[k, 3] += z * level
                line[k, 4] += r * solid_angle
                line[k, 5] += g * solid_angle
                line[k, 6] += b * solid_angle


@njit(cache=True, nogil=True)
def _fill_tables(blocks, moments, lit):  # type: ignore[no-untyped-def]
    """Fill tables whose first row and column are 0."""
    rows, columns, _ = blocks.shape
    for r in range(rows):
        power = x = y = z = 0.0
        number = 0
        for c in range(columns):
            block = blocks[r, c]
            power += block[0]
            x += block[1]
            y += block[2]
            z += block[3]
            number += block[0] > 0
            moments[r + 1, c + 1, 0] = moments[r, c + 1, 0] + power
            moments[r + 1, c + 1, 1] = moments[r, c + 1, 1] + x
            moments[r + 1, c + 1, 2] = moments[r, c + 1, 2] + y
            moments[r + 1, c + 1, 3] = moments[r, c + 1, 3] + z
            lit[r + 1, c + 1] = lit[r, c + 1] + number
