"""Fixed points carried to where the light is: the inverse CDF of luminance × solid angle.

The same points of the unit square are used for every map. One coordinate picks a row by the rows'
light, the other a cell within the row; inside a cell, azimuth and the cosine of the polar angle are
uniform, hence so is solid angle. As the map is the only thing that changes between frames, lights
slide with it instead of jumping at random, and n lights stand where the first n of any larger
number do.

Domain : world frame, lat-long grid (CONVENTIONS.md). Unseen cells count as what they hold.
Input  : EnvironmentMap.    Output : directions, irradiance and angular radius of each light.
Cost   : one pass over the map, and the cumulative sums of the rows that points fall in.
Fails  : a source that outshines all takes all lights (tests/limits/test_lights_small_sun.py);
         sources of equal power trade lights by whole 1/count steps (test_lights_two_suns.py); when
         one lamp dims as another brightens, lights cross the dark between them
         (test_lights_crossing.py); noise moves every light a little (test_lights_noise.py).

References
----------
.. [1] V. Havran, M. Smyk, G. Krawczyk, K. Myszkowski, H.-P. Seidel, "Interactive System for Dynamic
       Scene Lighting using Captured Video Environment Maps", Eurographics Symposium on Rendering,
       2005: directional lights that importance sampling draws from each frame of a captured
       video. This module is a baseline in its spirit, not a copy of its sampling.
"""

import numpy as np
from numba import njit

from lighting.maps.environment import LUMINANCE_WEIGHTS, EnvironmentMap
from lighting.sampling.low_discrepancy import low_discrepancy_points
from lighting.sampling.sampled_lights import (
    Array,
    Cells,
    directions_and_density,
    lights_of_samples,
    row_integrals,
)


def inverse_cdf(environment: EnvironmentMap, count: int) -> tuple[Array, Array, Array]:
    """Return `count` lights of equal luminous power whose irradiances sum to the map's integral.

    Parameters
    ----------
    environment : EnvironmentMap
    count : int
        Number of lights, at least 1. Exactly this many are returned, or none for a map without
        light.

    Returns
    -------
    directions, irradiance, angular_radius_rad : (count, 3), (count, 3), (count,) float64
        As `sampled_lights.lights_of_samples`.
    """
    return lights_of_points(environment, low_discrepancy_points(count))


def lights_of_points(environment: EnvironmentMap, points: Array) -> tuple[Array, Array, Array]:
    """Return the lights that points (n, 2) of the unit square are carried to, see `inverse_cdf`."""
    row_light = row_integrals(environment.radiance)
    if not row_light.any():
        return np.empty((0, 3)), np.empty((0, 3)), np.empty(0)
    cells, fractions = _carry(environment, row_light, points)
    return lights_of_samples(environment.radiance, row_light.sum(axis=0), cells, fractions)


def sample_directions(environment: EnvironmentMap, points: Array) -> tuple[Array, Array]:
    """Return the directions that points of the unit square are carried to, and their density.

    Parameters
    ----------
    environment : EnvironmentMap
    points : (n, 2) float64
        In [0, 1)²; uniform random points give directions with exactly the returned density.

    Returns
    -------
    directions : (n, 3) float64
        Unit vectors in the world frame.
    density : (n,) float64
        Probability per sr, positive: the luminance over its integral, constant in a cell.

    Raises
    ------
    ValueError
        If the map holds no light.
    """
    row_light = row_integrals(environment.radiance)
    if not row_light.any():
        raise ValueError("a map without light has no density to sample")
    cells, fractions = _carry(environment, row_light, points)
    return directions_and_density(environment.radiance, row_light.sum(axis=0), cells, fractions)


def _carry(environment: EnvironmentMap, row_light: Array, points: Array) -> tuple[Cells, Array]:
    """Return the cell (n, 2) of each point (n, 2), and how far into it, (n, 2)."""
    return _cells(environment.radiance, np.cumsum(row_light @ LUMINANCE_WEIGHTS), points)


@njit(cache=True, nogil=True)
def _cells(radiance, cumulative_rows, points):  # type: ignore[no-untyped-def]
    """Return row and column (n, 2) of the cell of each point (n, 2), and how far into it, (n, 2).

    Points are taken row by row, so that one row's cumulative sum is kept at a time, and rows
    without points are never read.
    """
    red, green, blue = LUMINANCE_WEIGHTS
    cells = np.empty(points.shape, np.intp)
    fractions = np.empty(points.shape)
    for i in range(len(points)):
        cells[i, 0], fractions[i, 0] = _invert(cumulative_rows, points[i, 1])

    cumulative = np.empty(radiance.shape[1])
    summed_row = -1
    for i in np.argsort(cells[:, 0]):
        row = cells[i, 0]
        if row != summed_row:
            total = 0.0
            for column in range(len(cumulative)):
                cell = radiance[row, column]
                total += red * cell[0] + green * cell[1] + blue * cell[2]
                cumulative[column] = total
            summed_row = row
        cells[i, 1], fractions[i, 1] = _invert(cumulative, points[i, 0])
    return cells, fractions


@njit(cache=True, nogil=True)
def _invert(cumulative, share):  # type: ignore[no-untyped-def]
    """Return the cell in which a share of the total lies, and how far into it.

    The cell is the first whose sum is strictly above the share, so it has light of its own. There
    is one, for a share below 1 times the total rounds to less than the total.
    """
    target = share * cumulative[-1]
    cell = np.searchsorted(cumulative, target, side="right")
    start = cumulative[cell - 1] if cell > 0 else 0.0
    return cell, (target - start) / (cumulative[cell] - start)
