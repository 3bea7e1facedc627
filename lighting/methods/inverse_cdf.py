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
from numpy.typing import NDArray

from lighting.environment import LUMINANCE_WEIGHTS, EnvironmentMap, luminance
from lighting.latlong import solid_angles
from lighting.low_discrepancy import low_discrepancy_points

Array = NDArray[np.float64]


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
    directions : (count, 3) float64
        Unit vectors in the world frame, toward the light.
    irradiance : (count, 3) float64
        Radiance × sr. Each light has the chromaticity of the cell that it lies in.
    angular_radius_rad : (count,) float64
        Radius of the cone of solid angle 1/(count · p), p the density at the light: its share of
        the sphere if all lights were like it. At most π/2, beyond which no surface sees all of it.

    Notes
    -----
    E_i = (Φ/count) L(d_i)/Y(d_i) is the usual estimate L/(count · p) with p = Y/Φ, Φ = ∫ Y dω and
    Y the luminance. It has the right luminance but only about the right colour, so each channel is
    then scaled by one factor that makes Σ E_i = ∫ L dω exact; a channel that no light caught is
    spread evenly over all. Colour is thus as coarse as the lights are few: one light has the mean
    colour of the map.
    """
    radiance = environment.radiance
    row_light = _row_integrals(radiance)
    integral = row_light.sum(axis=0)
    power = float(integral @ LUMINANCE_WEIGHTS)
    if power == 0:
        return np.empty((0, 3)), np.empty((0, 3)), np.empty(0)
    rows, columns, directions = _carry(radiance, row_light, low_discrepancy_points(count))
    cells = radiance[rows, columns].astype(np.float64)
    cell_luminance = luminance(cells)
    irradiance = cells * (power / count / cell_luminance)[:, None]
    density = cell_luminance / power
    return directions, _with_sum(irradiance, integral), _cone_radius(1 / (count * density))


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
    row_light = _row_integrals(environment.radiance)
    power = float(row_light.sum(axis=0) @ LUMINANCE_WEIGHTS)
    if power == 0:
        raise ValueError("a map without light has no density to sample")
    rows, columns, directions = _carry(environment.radiance, row_light, points)
    return directions, luminance(environment.radiance[rows, columns]) / power


def _carry(
    radiance: NDArray[np.float32], row_light: Array, points: Array
) -> tuple[NDArray[np.intp], NDArray[np.intp], Array]:
    """Return row (n,), column (n,) and direction (n, 3) of points (n, 2)."""
    height = len(radiance)
    cumulative_rows = np.cumsum(row_light @ LUMINANCE_WEIGHTS)
    cells, fractions = _cells(radiance, cumulative_rows, points)
    rows, columns = cells.T
    row_fraction, column_fraction = fractions.T

    edges = np.cos(np.linspace(0.0, np.pi, height + 1))
    cos_theta = edges[rows] + row_fraction * (edges[rows + 1] - edges[rows])
    sin_theta = np.sqrt((1 - cos_theta) * (1 + cos_theta))
    phi = np.pi - np.pi / height * (columns + column_fraction)
    directions = np.stack([sin_theta * np.sin(phi), cos_theta, sin_theta * np.cos(phi)], axis=-1)
    return rows, columns, directions


def _row_integrals(radiance: NDArray[np.float32]) -> Array:
    """Return ∫ L dω over each row and channel, (N, 3)."""
    return _row_sums(radiance) * solid_angles(len(radiance))[:, None]


def _with_sum(irradiance: Array, total: Array) -> Array:
    """Return irradiance (n, 3) scaled per channel to sum to `total` (3,)."""
    caught = irradiance.sum(axis=0)
    lit = caught > 0
    factor = np.divide(total, caught, out=np.zeros(3), where=lit)
    return irradiance * factor + np.where(lit, 0.0, total / len(irradiance))


def _cone_radius(solid_angle_sr: Array) -> Array:
    """Return the angle in rad between axis and edge of a cone, at most π/2."""
    share = np.minimum(solid_angle_sr / (4 * np.pi), 0.5)
    return 2 * np.arcsin(np.sqrt(share))


@njit(cache=True, nogil=True)
def _row_sums(radiance):  # type: ignore[no-untyped-def]
    """Sum over each row and channel in float64, (N, 3); numpy takes 15 times as long."""
    height, width, _ = radiance.shape
    sums = np.empty((height, 3))
    for row in range(height):
        red = green = blue = 0.0
        for column in range(width):
            red += radiance[row, column, 0]
            green += radiance[row, column, 1]
            blue += radiance[row, column, 2]
        sums[row, 0], sums[row, 1], sums[row, 2] = red, green, blue
    return sums


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
