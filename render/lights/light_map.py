"""Lights as a map, for what mirrors them where no map is given."""

import numpy as np
from numba import njit, prange
from numpy.typing import NDArray

from lighting.light_set import LightSet
from lighting.maps.environment import EnvironmentMap
from lighting.sphere import harmonics
from lighting.sphere.latlong import cell_directions, solid_angles

Array = NDArray[np.float64]


def map_of_lights(lights: LightSet, rows: int) -> EnvironmentMap:
    """Return the map (rows, 2 rows) of each light's disc, at least a cell, and of the fill.

    Its integral is the lights' irradiance and that of the fill, where that is nowhere negative.
    """
    directions = cell_directions(rows)
    weights = np.repeat(solid_angles(rows), 2 * rows)
    radiance = np.zeros((rows, 2 * rows, 3))
    if lights.fill.any():
        radiance = np.maximum(harmonics.basis(directions) @ lights.fill, 0.0)
    flat = radiance.reshape(-1, 3)
    cosines = np.cos(lights.angular_radius_rad)
    _add_discs(
        directions.reshape(-1, 3), weights, lights.directions, lights.irradiance, cosines, flat
    )
    seen = np.ones((rows, 2 * rows), np.bool_)
    return EnvironmentMap(radiance.astype(np.float32), seen, ~seen)


@njit(cache=True, nogil=True, parallel=True)
def _add_discs(
    cells: Array, weights: Array, directions: Array, irradiance: Array, cosines: Array, out: Array
) -> None:  # pragma: no cover - compiled
    """Add each light, spread over the cells whose centre is in its disc, or over the nearest."""
    edges = np.empty(len(directions))
    totals = np.zeros(len(directions))
    for k in prange(len(directions)):
        nearest = -1.0
        for i in range(len(cells)):
            nearest = max(nearest, _cosine(cells[i], directions[k]))
        edges[k] = min(cosines[k], nearest)
        for i in range(len(cells)):
            if _cosine(cells[i], directions[k]) >= edges[k]:
                totals[k] += weights[i]
    for i in prange(len(cells)):
        for k in range(len(directions)):
            if _cosine(cells[i], directions[k]) >= edges[k]:
                for c in range(3):
                    out[i, c] += irradiance[k, c] / totals[k]


@njit(nogil=True)
def _cosine(a: Array, b: Array) -> float:  # pragma: no cover - compiled
    return float(a[0] * b[0] + a[1] * b[1] + a[2] * b[2])
