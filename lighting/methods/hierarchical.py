"""Fixed points warped to where the light is, down a pyramid of luminance × solid angle.

Each entry of the pyramid is the light of four of the level below. A point goes down from the top:
its second coordinate picks the upper or the lower pair by their light, its first the left or the
right of the pair, and each coordinate is stretched back to [0, 1) for the next level. What is left
of them at the bottom is the place in the cell. The points are those of inverse_cdf.py, the same for
every map, and n lights stand where the first n of any larger number do.

Domain : world frame, lat-long grid (CONVENTIONS.md). Unseen cells count as what they hold.
Input  : EnvironmentMap.    Output : directions, irradiance and angular radius of each light.
Cost   : one pass over the map and one over the pyramid; log₂ 2N steps for each light.
Fails  : the warp is torn where blocks of the pyramid meet: a light that stands in one block jumps
         to another as a source moves between them (tests/limits/test_hierarchical_borders.py);
         else as inverse_cdf.py does.

References
----------
.. [1] P. Clarberg, W. Jarosz, T. Akenine-Möller, H. W. Jensen, "Wavelet Importance Sampling:
       Efficiently Evaluating Products of Complex Functions", SIGGRAPH, 2005: the warp, there of the
       product of a map and a BRDF.
"""

import numpy as np
from numba import njit
from numpy.typing import NDArray

from lighting.maps.environment import LUMINANCE_WEIGHTS, EnvironmentMap
from lighting.sampling.low_discrepancy import low_discrepancy_points
from lighting.sampling.sampled_lights import (
    Array,
    Cells,
    directions_and_density,
    lights_of_samples,
    row_integrals,
)
from lighting.sphere.latlong import solid_angles


def hierarchical(environment: EnvironmentMap, count: int) -> tuple[Array, Array, Array]:
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
    integral = row_integrals(environment.radiance).sum(axis=0)
    if not integral.any():
        return np.empty((0, 3)), np.empty((0, 3)), np.empty(0)
    cells, fractions = _warp(environment.radiance, low_discrepancy_points(count))
    return lights_of_samples(environment.radiance, integral, cells, fractions)


def sample_directions(environment: EnvironmentMap, points: Array) -> tuple[Array, Array]:
    """Return the directions that points of the unit square are warped to, and their density.

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
    integral = row_integrals(environment.radiance).sum(axis=0)
    if not integral.any():
        raise ValueError("a map without light has no density to sample")
    cells, fractions = _warp(environment.radiance, points)
    return directions_and_density(environment.radiance, integral, cells, fractions)


def _warp(radiance: NDArray[np.float32], points: Array) -> tuple[Cells, Array]:
    """Return the cell (n, 2) of each point (n, 2), and how far into it, (n, 2)."""
    shapes = [radiance.shape[:2]]
    while shapes[-1] != (1, 1):
        height, width = shapes[-1]
        shapes.append((-(-height // 2), -(-width // 2)))
    # Levels lie one after the other, each padded by a dark row and column where its size is odd, so
    # that every entry above has four below it.
    padded = [(height + height % 2, width + width % 2) for height, width in shapes]
    starts = np.cumsum([0] + [height * width for height, width in padded])
    pyramid = np.zeros(starts[-1])
    widths = np.array([width for _, width in padded])
    _fill_pyramid(radiance, solid_angles(len(radiance)), np.array(shapes), widths, starts, pyramid)
    return _descend(pyramid, widths, starts, points)


@njit(cache=True, nogil=True)
def _fill_pyramid(radiance, solid_angle, shapes, widths, starts, pyramid):  # type: ignore[no-untyped-def]
    """Fill the levels, the bottom first, of a pyramid that is 0."""
    red, green, blue = LUMINANCE_WEIGHTS
    for row in range(shapes[0, 0]):
        for column in range(shapes[0, 1]):
            cell = radiance[row, column]
            light = red * cell[0] + green * cell[1] + blue * cell[2]
            pyramid[row * widths[0] + column] = light * solid_angle[row]
    for level in range(1, len(shapes)):
        for row in range(shapes[level, 0]):
            above = starts[level - 1] + 2 * row * widths[level - 1]
            below = above + widths[level - 1]
            for column in range(shapes[level, 1]):
                pyramid[starts[level] + row * widths[level] + column] = (
                    pyramid[above + 2 * column]
                    + pyramid[above + 2 * column + 1]
                    + pyramid[below + 2 * column]
                    + pyramid[below + 2 * column + 1]
                )


@njit(cache=True, nogil=True)
def _descend(pyramid, widths, starts, points):  # type: ignore[no-untyped-def]
    cells = np.zeros(points.shape, np.intp)
    fractions = points.copy()
    for i in range(len(points)):
        x, y = points[i]
        row = column = 0
        for level in range(len(widths) - 2, -1, -1):
            row, column = 2 * row, 2 * column
            above = starts[level] + row * widths[level] + column
            below = above + widths[level]
            upper = pyramid[above] + pyramid[above + 1]
            is_lower, y = _choose(upper, pyramid[below] + pyramid[below + 1], y)
            pair = below if is_lower else above
            is_right, x = _choose(pyramid[pair], pyramid[pair + 1], x)
            row += is_lower
            column += is_right
        cells[i] = row, column
        fractions[i] = y, x
    return cells, fractions


@njit(cache=True, nogil=True)
def _choose(first, second, share):  # type: ignore[no-untyped-def]
    """Return whether a share in [0, 1) of the light lies in the second part, and how far into it.

    Never in a part without light: a share below 1 times the total rounds to less than the total,
    also where the total was rounded up. So what is left of the share is again below 1.
    """
    target = share * (first + second)
    if target < first:
        return False, target / first
    return True, (target - first) / second
