"""Lights as a map, for what mirrors them where no map is given."""

import math
from functools import lru_cache

import numpy as np
from numba import njit
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
    directions, basis = _grid(rows)
    radiance = np.zeros((rows, 2 * rows, 3))
    if lights.fill.any():
        radiance = np.maximum(basis @ lights.fill, 0.0)
    _add_discs(
        directions, solid_angles(rows), lights.directions, lights.irradiance,
        lights.angular_radius_rad, radiance,
    )  # fmt: skip
    seen = np.ones((rows, 2 * rows), np.bool_)
    return EnvironmentMap(radiance.astype(np.float32), seen, ~seen)


@lru_cache(maxsize=2)
def _grid(rows: int) -> tuple[Array, Array]:
    """Return a map's directions (rows, 2 rows, 3) and harmonics (rows, 2 rows, 9) there."""
    directions = cell_directions(rows)
    return directions, harmonics.basis(directions)


@njit(cache=True, nogil=True)
def _add_discs(
    cells: Array,
    weights: Array,
    directions: Array,
    irradiance: Array,
    radius_rad: Array,
    out: Array,
) -> None:  # pragma: no cover - compiled
    """Add each light, spread over the cells whose centre is in its disc, or over the nearest."""
    rows = len(cells)
    for k in range(len(directions)):
        # The rows that the disc crosses, and with them those around its middle.
        theta_rad = math.atan2(math.hypot(directions[k, 0], directions[k, 2]), directions[k, 1])
        first = max(int((theta_rad - radius_rad[k]) * rows / math.pi) - 1, 0)
        last = min(int((theta_rad + radius_rad[k]) * rows / math.pi) + 2, rows)
        edge = -1.0
        for row in range(first, last):
            for column in range(2 * rows):
                edge = max(edge, _cosine(cells[row, column], directions[k]))
        edge = min(edge, math.cos(radius_rad[k]))
        total = 0.0
        for row in range(first, last):
            for column in range(2 * rows):
                if _cosine(cells[row, column], directions[k]) >= edge:
                    total += weights[row]
        for row in range(first, last):
            for column in range(2 * rows):
                if _cosine(cells[row, column], directions[k]) >= edge:
                    for c in range(3):
                        out[row, column, c] += irradiance[k, c] / total


@njit(nogil=True)
def _cosine(a: Array, b: Array) -> float:  # pragma: no cover - compiled
    return float(a[0] * b[0] + a[1] * b[1] + a[2] * b[2])
