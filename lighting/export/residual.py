"""What is left of an environment map once lights were taken out of it: each exactly once.

Domain : world frame, lat-long grid (CONVENTIONS.md), radiance constant over each cell.
Input  : a map, and the lights that will shine beside it.    Output : the map without their light.
A light's source is looked for in a cap around its direction. There the map is cut at the level
above which lies just the light's irradiance, channel by channel: what is taken is the peak, what
stays is the sky or the wall around it. Light plus residual is then the map, and counts nothing
twice.
Cost   : for each light a product with the rows that its cap crosses, and a sort of its cells.
Fails  : where a cap holds less light than the light it belongs to: all of it is taken, and the
         caller is told how much that was. A light that stands for more than a peak (a cell of the
         map, a sample) leaves a hole, for its cap is dark before its irradiance is reached. A
         brighter source in the same cap is cut in place of the light's own
         (tests/limits/test_residual_neighbour.py).
"""

from dataclasses import replace
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from lighting.light_set import LightSet
from lighting.maps.environment import EnvironmentMap
from lighting.sphere.latlong import cell_directions, solid_angles

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
    weights = np.broadcast_to(solid_angles(height)[:, None], radiance.shape[:2])
    removed = np.zeros((len(lights), 3))
    for index, direction in enumerate(lights.directions):
        radius = (
            max(_RADII * lights.angular_radius_rad[index], _LEAST_RAD) + _CELLS * np.pi / height
        )
        rows, in_cap = _cap(direction, radius, height)
        weight, before = weights[rows][in_cap], radiance[rows][in_cap]
        after = before.copy()
        for channel in range(3):
            level = _cut_level(before[:, channel], weight, lights.irradiance[index, channel])
            np.minimum(after[:, channel], level, out=after[:, channel])
        radiance[rows][in_cap] = after
        removed[index] = weight @ (before.astype(np.float64) - after)
    return replace(environment, radiance=radiance), removed


def _cap(
    direction: NDArray[np.float64], radius_rad: float, height: int
) -> tuple[slice, NDArray[np.bool_]]:
    """Return the rows that a cap crosses, and which of their cells have their centre in it."""
    theta = np.arctan2(np.hypot(direction[0], direction[2]), direction[1])
    first = max(int((theta - radius_rad) * height / np.pi) - 1, 0)
    last = min(int((theta + radius_rad) * height / np.pi) + 2, height)
    rows = slice(first, last)
    return rows, _directions(height)[rows] @ direction >= np.cos(min(radius_rad, np.pi))


@lru_cache(maxsize=2)
def _directions(height: int) -> NDArray[np.float64]:
    return cell_directions(height)


def _cut_level(
    radiance: NDArray[np.float32], weights: NDArray[np.float64], irradiance: float
) -> np.float32:
    """Return the level t ≥ 0 with Σ w max(L − t, 0) = irradiance, or 0 if there is less light.

    The k brightest cells alone, cut at t, give Σ w L − t Σ w; among them is the level for the first
    k where the next cell is no brighter than t.
    """
    order = np.argsort(-radiance)
    brightest = radiance[order].astype(np.float64)
    total, width = np.cumsum(brightest * weights[order]), np.cumsum(weights[order])
    levels = (total - irradiance) / width
    is_last = levels >= np.append(brightest[1:], 0.0)
    if not is_last.any():
        return np.float32(0)
    return np.float32(levels[np.argmax(is_last)])
