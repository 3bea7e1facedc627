"""What is left of an environment map once lights were taken out of it: each exactly once.

Domain : world frame, lat-long grid (CONVENTIONS.md), radiance constant over each cell.
Input  : a map, and the lights that will shine beside it.    Output : the map without their light.
A light's source is looked for in a cap around its direction. There the map is cut at the level
above which lies just the light's irradiance, channel by channel: what is taken is the peak, what
stays is the sky or the wall around it. Light plus residual is then the map, and counts nothing
twice.
Cost   : for each light the rows that its cap crosses, and some ten times the cells in it.
Fails  : where a cap holds less light than the light it belongs to: all of it is taken, and the
         caller is told how much that was. A light that stands for more than a peak (a cell of the
         map, a sample) leaves a hole, for its cap is dark before its irradiance is reached. A
         brighter source in the same cap is cut in place of the light's own
         (tests/limits/test_residual_neighbour.py).
"""

import math
from dataclasses import replace

import numpy as np
from numba import njit
from numpy.typing import NDArray

from lighting.light_set import LightSet
from lighting.maps.environment import EnvironmentMap
from lighting.sphere.latlong import solid_angles

_RADII = 2.0
"""Radius of the cap in radii of the light. The light's radius is the one of the uniform disc with
the source's spread: a Gaussian's is 2 σ, so the cap holds 4 σ; a thin tube's is 0.41 of its length,
so the cap holds it whole."""
_LEAST_RAD = np.radians(5.0)
"""Key lights are gathered over 4° (key_lights.py), their glow included, and over whole blocks of
the map; a smaller cap would look for the glow's light in the sky before it."""
_CELLS = 1.5
"""Added to it, in rows: a source of one cell lies up to 0.7 from the cell's centre, and one that
crosses a border lies in two."""


def remove_lights(
    environment: EnvironmentMap, lights: LightSet
) -> tuple[EnvironmentMap, NDArray[np.float64]]:
    """Return the residual map, and the irradiance that was found in it and removed, (K, 3).

    Nowhere is the residual negative or brighter than the map, and its integral plus what was
    removed is the map's. Lights are removed one after the other, so that where caps overlap a later
    one finds what the earlier ones left. `removed` is at most each light's irradiance; where it is
    less, the map has no such source there. The marks (valid, clipped) stay as they were. The
    lights' fill is not removed.
    """
    height = environment.height
    radiance = environment.radiance.copy()
    removed = np.zeros((len(lights), 3))
    radius_rad = np.maximum(_RADII * lights.angular_radius_rad, _LEAST_RAD)
    radius_rad = np.minimum(radius_rad + _CELLS * np.pi / height, np.pi)
    _remove(
        radiance, solid_angles(height), lights.directions, lights.irradiance, radius_rad, removed
    )
    return replace(environment, radiance=radiance), removed


@njit(cache=True, nogil=True)
def _remove(
    radiance: NDArray[np.float32],
    weights: NDArray[np.float64],
    directions: NDArray[np.float64],
    irradiance: NDArray[np.float64],
    radius_rad: NDArray[np.float64],
    removed: NDArray[np.float64],
) -> None:  # pragma: no cover - compiled
    """Cut the map (N, 2N, 3), whose rows have weights (N,), under each light's cap."""
    cells = np.empty((radiance.shape[0] * radiance.shape[1], 2), np.int32)
    for k in range(len(directions)):
        count = _find_cap(directions[k], radius_rad[k], radiance.shape[0], cells)
        for channel in range(3):
            level = np.float32(
                _cut_level(radiance, weights, cells[:count], channel, irradiance[k, channel])
            )
            for row, column in cells[:count]:
                above = radiance[row, column, channel] - level
                if above > 0:
                    removed[k, channel] += weights[row] * np.float64(above)
                    radiance[row, column, channel] = level


@njit(nogil=True)
def _find_cap(
    direction: NDArray[np.float64], radius_rad: float, height: int, cells: NDArray[np.int32]
) -> int:  # pragma: no cover - compiled
    """List the cells (row, column) whose centre is in a cap, and return how many they are."""
    x, y, z = direction
    theta_rad = math.atan2(math.hypot(x, z), y)
    first = max(int((theta_rad - radius_rad) * height / math.pi) - 1, 0)
    last = min(int((theta_rad + radius_rad) * height / math.pi) + 2, height)
    edge = math.cos(radius_rad)
    level = np.empty(2 * height)
    for column in range(2 * height):
        phi_rad = math.pi - math.pi * (column + 0.5) / height
        level[column] = x * math.sin(phi_rad) + z * math.cos(phi_rad)
    count = 0
    for row in range(first, last):
        of_row_rad = math.pi * (row + 0.5) / height
        sine, least = math.sin(of_row_rad), edge - y * math.cos(of_row_rad)
        for column in range(2 * height):
            if sine * level[column] >= least:
                cells[count] = row, column
                count += 1
    return count


@njit(nogil=True)
def _cut_level(
    radiance: NDArray[np.float32],
    weights: NDArray[np.float64],
    cells: NDArray[np.int32],
    channel: int,
    irradiance: float,
) -> float:  # pragma: no cover - compiled
    """Return the level t ≥ 0 with Σ w max(L − t, 0) = irradiance, or 0 if there is less light.

    Were all cells brighter than t, it would be (Σ w L − irradiance) / Σ w, which is at most t: so
    darker ones are left out, and t rises until none is.
    """
    level, above = -1.0, len(cells)
    while above > 0:
        light, width, before, above = 0.0, 0.0, above, 0
        for row, column in cells:
            value = np.float64(radiance[row, column, channel])
            if value > level:
                light += weights[row] * value
                width += weights[row]
                above += 1
        if above in (0, before) and level >= 0:
            break
        level = (light - irradiance) / width
        if level < 0:
            return 0.0
    return max(level, 0.0)
