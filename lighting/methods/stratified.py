"""Stratified random points carried to where the light is, the plainest sampler worth the name.

The unit square is cut into as many strata of equal area as there are lights, and a random point of
each goes through the inverse CDF of luminance × solid angle (inverse_cdf.py).

Domain : world frame, lat-long grid (CONVENTIONS.md). Unseen cells count as what they hold.
Input  : EnvironmentMap.    Output : directions, irradiance and angular radius of each light.
Cost   : that of inverse_cdf.py, and two random numbers for each light.
Fails  : as inverse_cdf.py does, and one light more moves every other
         (tests/limits/test_stratified_count.py).
"""

import math

import numpy as np

from lighting.maps.environment import EnvironmentMap
from lighting.methods import inverse_cdf
from lighting.sampling.sampled_lights import Array


def stratified_random(
    environment: EnvironmentMap, count: int, *, seed: int = 0
) -> tuple[Array, Array, Array]:
    """Return `count` lights of equal luminous power whose irradiances sum to the map's integral.

    Parameters
    ----------
    environment : EnvironmentMap
    count : int
        Number of lights, at least 1. Exactly this many are returned, or none for a map without
        light.
    seed : int
        Of the random numbers. The same for every frame unless told, so that lights move with the
        map alone.

    Returns
    -------
    directions, irradiance, angular_radius_rad : (count, 3), (count, 3), (count,) float64
        As `sampled_lights.lights_of_samples`.
    """
    points = stratified_points(count, np.random.default_rng(seed))
    return inverse_cdf.lights_of_points(environment, points)


def sample_directions(
    environment: EnvironmentMap, count: int, generator: np.random.Generator
) -> tuple[Array, Array]:
    """Return stratified random directions and their density, as `inverse_cdf.sample_directions`.

    Returns
    -------
    directions : (count, 3) float64
        One in each of `count` parts of equal power. All together have exactly the returned density;
        a single one is confined to its own part.
    density : (count,) float64
        Probability per sr.

    Raises
    ------
    ValueError
        If the map holds no light.
    """
    return inverse_cdf.sample_directions(environment, stratified_points(count, generator))


def stratified_points(count: int, generator: np.random.Generator) -> Array:
    """Return a random point of each of `count` strata of equal area of the unit square, (count, 2).

    Strata stand in about √count rows of the second coordinate. A row is as high as the number of
    its strata, which differs by at most one between rows, so any count is served exactly.
    """
    row_count = round(math.sqrt(count))
    first = np.arange(row_count + 1) * count // row_count  # stratum of each row
    per_row = np.diff(first)
    row = np.repeat(np.arange(row_count), per_row)
    within_row = np.arange(count) - first[row]
    x, y = generator.random((2, count))
    points = np.stack([(within_row + x) / per_row[row], (first[row] + y * per_row[row]) / count])
    # Rounding may carry the last point of a row or column to its end, which lies outside.
    return np.minimum(points.T, np.nextafter(1.0, 0.0))
