"""Lights of equal luminous power that stand for samples of a map, drawn where its light is.

A sample is a cell of the map and a place inside it. Inside a cell, azimuth and the cosine of the
polar angle run evenly, hence so does solid angle: samples that are uniform in their cells, of cells
drawn by luminance × solid angle, have the density p = Y/Φ, Φ = ∫ Y dω and Y the luminance.

Domain : world frame, lat-long grid (CONVENTIONS.md), radiance constant over each cell of the map.
Input  : radiance, its integral, samples.    Output : directions, and their density or lights.
Cost   : `row_integrals` is one pass over the map; all else is per sample.
Fails  : colour is as coarse as the lights are few, and is the cell's own, not its surroundings'.
"""

import numpy as np
from numba import njit
from numpy.typing import NDArray

from lighting.maps.environment import LUMINANCE_WEIGHTS, luminance
from lighting.sphere.latlong import solid_angles

Array = NDArray[np.float64]
Cells = NDArray[np.intp]


def row_integrals(radiance: NDArray[np.float32]) -> Array:
    """Return ∫ L dω over each row and channel, (N, 3), of radiance (N, 2N, 3)."""
    return _row_sums(radiance) * solid_angles(len(radiance))[:, None]


def lights_of_samples(
    radiance: NDArray[np.float32], integral: Array, cells: Cells, fractions: Array
) -> tuple[Array, Array, Array]:
    """Return a light for each sample; their irradiances sum to the map's integral.

    Parameters
    ----------
    radiance : (N, 2N, 3) float32
        Linear Rec.709.
    integral : (3,) float64
        ∫ L dω of the map, with light in it.
    cells : (n, 2) int
        Row and column of each sample's cell, which has light.
    fractions : (n, 2) float64
        How far down and how far to the right in the cell, in [0, 1].

    Returns
    -------
    directions : (n, 3) float64
        Unit vectors in the world frame, toward the light.
    irradiance : (n, 3) float64
        Radiance × sr. Each light has the chromaticity of its cell.
    angular_radius_rad : (n,) float64
        Radius of the cone of solid angle 1/(n p): the light's share of the sphere if all lights
        were like it. At most π/2, beyond which no surface sees all of it.

    Notes
    -----
    E_i = (Φ/n) L(d_i)/Y(d_i) is the usual estimate L/(n p) with p = Y/Φ. It has the right luminance
    but only about the right colour, so each channel is then scaled by one factor that makes
    Σ E_i = ∫ L dω exact; a channel that no light caught is spread evenly over all. One light has
    the mean colour of the map.
    """
    directions, density = directions_and_density(radiance, integral, cells, fractions)
    light = radiance[cells[:, 0], cells[:, 1]].astype(np.float64)
    irradiance = light / (len(cells) * density)[:, None]
    return directions, with_sum(irradiance, integral), cone_radius(1 / (len(cells) * density))


def directions_and_density(
    radiance: NDArray[np.float32], integral: Array, cells: Cells, fractions: Array
) -> tuple[Array, Array]:
    """Return unit directions (n, 3) of samples and their density (n,) per sr; see above."""
    rows, columns = cells.T
    height = len(radiance)
    edges = np.cos(np.linspace(0.0, np.pi, height + 1))
    cos_theta = edges[rows] + fractions[:, 0] * (edges[rows + 1] - edges[rows])
    sin_theta = np.sqrt((1 - cos_theta) * (1 + cos_theta))
    phi = np.pi - np.pi / height * (columns + fractions[:, 1])
    directions = np.stack([sin_theta * np.sin(phi), cos_theta, sin_theta * np.cos(phi)], axis=-1)
    power = float(integral @ LUMINANCE_WEIGHTS)
    return directions, luminance(radiance[rows, columns].astype(np.float64)) / power


def with_sum(irradiance: Array, total: Array) -> Array:
    """Return irradiance (n, 3) scaled per channel to sum to `total` (3,)."""
    caught = irradiance.sum(axis=0)
    lit = caught > 0
    factor = np.divide(total, caught, out=np.zeros(3), where=lit)
    return irradiance * factor + np.where(lit, 0.0, total / len(irradiance))


def cone_radius(solid_angle_sr: Array) -> Array:
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
