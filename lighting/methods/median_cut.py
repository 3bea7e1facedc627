"""Median cut: halve the light of the brightest cell, across its longer side.

Domain : world frame, lat-long grid (CONVENTIONS.md). Unseen cells count as what they hold.
Input  : EnvironmentMap.    Output : directions, irradiance and angular radius of each light.
Cost   : one pass over the map; then, for each light, a look at one side of one cell.
Fails  : a cut into equal halves passes right through a bright source, and each half goes to the
         centroid of what else its cell holds (tests/limits/test_median_cut_source.py).

References
----------
.. [1] P. Debevec, "A Median Cut Algorithm for Light Probe Sampling", SIGGRAPH posters, 2005.
"""

import numpy as np
from numba import njit
from numpy.typing import NDArray

from lighting.blocks.summed_area import block_sums, rectangle_lit, rectangle_moments
from lighting.cells.cell_splitting import Array, Cell, first_part_end, lights_of_cells
from lighting.maps.environment import EnvironmentMap


def median_cut(environment: EnvironmentMap, count: int) -> tuple[Array, Array, Array]:
    """Return `count` lights for the cells of a map, cut for halves of equal luminous power.

    Parameters
    ----------
    environment : EnvironmentMap
    count : int
        Number of lights, at least 1. Fewer are returned if they hold all the light: one for each
        block of the map (summed_area.py) that has any.

    Returns
    -------
    directions : (n, 3) float64
        Unit vectors in the world frame, toward the light.
    irradiance : (n, 3) float64
        Radiance × sr. They sum to the map's integral.
    angular_radius_rad : (n,) float64
        Radius of the disc that is spread as the light is.

    Notes
    -----
    The poster [1]_ cuts all regions in rounds, which makes 2ⁿ. For any count, the cell with the
    most light is cut next: after halving, those of a round come before those of the next, but for
    what cells are too coarse to halve. The longer side is that on the sphere, where the width
    shrinks with the sine of the polar angle of the cell's middle; if no cut across it leaves light
    in both parts, the other side is cut.
    """
    return median_cut_of_blocks(block_sums(environment.radiance), count)


def median_cut_of_blocks(blocks: Array, count: int) -> tuple[Array, Array, Array]:
    """Return what `median_cut` does, from sums over blocks (rows, columns, 7)."""
    return lights_of_cells(blocks, count, _halving, _power)


def _power(power: float, x: float, y: float, z: float) -> float:
    return power


def _halving(moments: Array, lit: NDArray[np.int64], cell: Cell) -> int:
    top, bottom, left, right = cell
    middle_theta = np.pi / (len(lit) - 1) * (top + bottom) / 2
    is_wide = bool((right - left) * np.sin(middle_theta) >= bottom - top)
    cut = _nearest_half(moments, lit, *cell, is_wide)
    return cut if cut >= 0 else _nearest_half(moments, lit, *cell, not is_wide)


@njit(cache=True, nogil=True)
def _nearest_half(moments, lit, top, bottom, left, right, by_columns):  # type: ignore[no-untyped-def]
    """Return the cut that parts the light most evenly; −1 if each leaves one side dark."""
    total = rectangle_moments(moments, top, bottom, left, right)[0]
    total_lit = rectangle_lit(lit, top, bottom, left, right)
    column_cuts, row_cuts = right - left - 1, bottom - top - 1
    best = -1
    least = np.inf
    for k in range(column_cuts if by_columns else row_cuts):
        cut = k if by_columns else column_cuts + k
        end_row, end_column = first_part_end(cut, top, bottom, left, right)
        first_lit = rectangle_lit(lit, top, end_row, left, end_column)
        if first_lit == 0 or first_lit == total_lit:
            continue
        first = rectangle_moments(moments, top, end_row, left, end_column)[0]
        unevenness = abs(2 * first - total)
        if unevenness < least:
            best, least = cut, unevenness
    return best
