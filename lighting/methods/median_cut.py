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
from numpy.typing import NDArray

from lighting.cell_splitting import Array, Cell, lights_of_cells
from lighting.environment import EnvironmentMap


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
    return lights_of_cells(environment, count, _halving, _power)


def _power(power: float, x: float, y: float, z: float) -> float:
    return power


def _halving(moments: Array, lit: NDArray[np.int64], cell: Cell) -> int:
    top, bottom, left, right = cell
    columns = np.s_[left : right + 1]
    rows = np.s_[top : bottom + 1]
    by_column = _nearest_half(
        moments[bottom, columns, 0] - moments[top, columns, 0],
        lit[bottom, columns] - lit[top, columns],
    )
    by_row = _nearest_half(
        moments[rows, right, 0] - moments[rows, left, 0], lit[rows, right] - lit[rows, left]
    )
    middle_theta = np.pi / (len(lit) - 1) * (top + bottom) / 2
    is_wide = (right - left) * np.sin(middle_theta) >= bottom - top
    if by_row is None or (is_wide and by_column is not None):
        assert by_column is not None  # two lit blocks differ in row or in column
        return by_column
    return right - left - 1 + by_row


def _nearest_half(power: Array, lit: NDArray[np.int64]) -> int | None:
    """Return the cut next to half the power, from running sums (n + 1,) along a side of n.

    Only cuts with light on both sides count; None if there is none.
    """
    first, last = np.searchsorted(lit - lit[0], [1, lit[-1] - lit[0]])
    if first == last:
        return None
    halves = np.abs(2 * power[first:last] - power[0] - power[-1])
    return int(first + np.argmin(halves)) - 1
