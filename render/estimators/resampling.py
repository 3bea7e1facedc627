"""Directions proposed by the light or the BRDF, and kept by the product of both: sample, resample.

Only what is kept is looked at for shadow. Candidates are proposed by one density q, and each has
the luminance w of f L n·l / q for its weight, known without a ray.

- Sampling-importance-resampling [2]_: of each `GROUP` candidates one is kept, by w, and stands for
  their mean w.
- Rejection [1]_: a candidate is kept with probability w / C, where C bounds w. The fewer are kept,
  the larger the bound is over the mean. Where a weight exceeds C it is kept and counts in full.

References
----------
.. [1] D. Burke, A. Ghosh, W. Heidrich, "Bidirectional Importance Sampling for Direct Illumination",
       Eurographics Symposium on Rendering, 2005.
.. [2] J. Talbot, D. Cline, P. Egbert, "Importance Resampling for Global Illumination", Eurographics
       Symposium on Rendering, 2005.
"""

import math

import numpy as np
from numba import njit, prange

from lighting.maps.environment import LUMINANCE_WEIGHTS, luminance
from render.estimators.brdf_sampling import draw_reflected, mirror_share, reflected_density
from render.estimators.contract import Estimate, Floats, Setting, Shadows
from render.estimators.map_tables import MapTables, cell_of, draw_from_map, map_tables
from render.estimators.points import Points, net, random, shift_of, shifted
from render.estimators.shading import (
    CARRIED,
    FIELDS,
    TOWARD,
    add_visible,
    luminance_of,
    reflect,
    start_at,
)
from render.rays.embree import PACKET, packet
from render.reference.surfaces import ALPHA2, F0, F90, HIT, MATT, NORMAL, TO_EYE

GROUP = 8
"""Candidates of which one is kept."""


def resampling(setting: Setting, *, by_light: bool) -> Estimate:
    """Prepare to resample what the light proposes, or else the BRDF."""
    tables = map_tables(setting.environment)

    def estimate(surfaces: Floats, samples: int, seed: int, radiance: Floats) -> int:
        return int(
            _resample(setting.shadows, tables, by_light, surfaces, net(samples), seed, radiance)
        )

    return estimate


def rejection(setting: Setting, *, by_light: bool) -> Estimate:
    """Prepare to reject from what the light proposes, or else the BRDF."""
    environment = setting.environment
    tables = map_tables(environment)
    power = float(environment.integral() @ LUMINANCE_WEIGHTS)
    bound = power if by_light else float(luminance(environment.radiance).max())

    def estimate(surfaces: Floats, samples: int, seed: int, radiance: Floats) -> int:
        return int(
            _reject(
                setting.shadows, tables, by_light, bound, surfaces, net(samples), seed, radiance
            )
        )

    return estimate


@njit(cache=True, nogil=True, parallel=True, error_model="numpy")
def _resample(
    shadows: Shadows,
    tables: MapTables,
    by_light: bool,
    surfaces: Floats,
    points: Points,
    seed: int,
    radiance: Floats,
) -> int:  # pragma: no cover - compiled
    traced = 0
    groups = (len(points) + GROUP - 1) // GROUP
    for k in prange(len(surfaces)):
        surface = surfaces[k]
        if surface[HIT].max() == 0:
            continue
        shadow = packet()
        start_at(surface, shadow)
        light = np.zeros((FIELDS, PACKET), np.float32)
        kept = np.zeros((FIELDS, PACKET), np.float32)
        total = np.zeros(PACKET, np.float32)
        for group in range(groups):
            # Strided, so that the candidates of each group are spread evenly too.
            members = range(group, len(points), groups)
            kept[:], total[:] = 0, 0
            for s in members:
                _propose(tables, by_light, points, s, seed, k, surface, light)
                reflect(shadows, surface, light)
                for i in range(PACKET):
                    weight = luminance_of(light, i)
                    total[i] += weight
                    if weight > 0 and random(seed, k, i, s) * total[i] < weight:
                        for row in range(TOWARD, CARRIED):
                            kept[row, i] = light[row, i]
                        for row in range(CARRIED, FIELDS):
                            kept[row, i] = light[row, i] / weight
            for row in range(CARRIED, FIELDS):
                # Each group stands for its share of all candidates: (Σ w / n) n / N.
                kept[row] *= total / np.float32(len(points))
            traced += add_visible(shadows, surface, kept, shadow, radiance[k])
    return traced


@njit(cache=True, nogil=True, parallel=True, error_model="numpy")
def _reject(
    shadows: Shadows,
    tables: MapTables,
    by_light: bool,
    brightest: float,
    surfaces: Floats,
    points: Points,
    seed: int,
    radiance: Floats,
) -> int:  # pragma: no cover - compiled
    traced = 0
    for k in prange(len(surfaces)):
        surface = surfaces[k]
        if surface[HIT].max() == 0:
            continue
        shadow = packet()
        start_at(surface, shadow)
        light = np.zeros((FIELDS, PACKET), np.float32)
        bound = np.zeros(PACKET)
        for i in range(PACKET):
            bound[i] = brightest * (_most_reflected(surface, i) if by_light else 1)
        for s in range(len(points)):
            _propose(tables, by_light, points, s, seed, k, surface, light)
            reflect(shadows, surface, light)
            for i in range(PACKET):
                weight = luminance_of(light, i)
                is_kept = weight > 0 and random(seed, k, i, s) * bound[i] < weight
                scale = max(bound[i] / weight, 1) / len(points) if is_kept else 0
                for row in range(CARRIED, FIELDS):
                    light[row, i] *= scale
            traced += add_visible(shadows, surface, light, shadow, radiance[k])
    return traced


@njit(nogil=True, error_model="numpy")
def _propose(
    tables: MapTables,
    by_light: bool,
    points: Points,
    s: int,
    seed: int,
    k: int,
    surface: Floats,
    light: Floats,
) -> None:  # pragma: no cover - compiled
    """Set directions, and radiance over density for what they carry."""
    for i in range(PACKET):
        light[CARRIED:FIELDS, i] = 0
        if surface[HIT, i] == 0 or tables.rows[-1] == 0:
            continue
        u, v = shifted(points, s, shift_of(seed, k, i))
        if by_light:
            row, column, x, y, z = draw_from_map(tables, u, v)
            density = float(tables.density[row, column])
        else:
            share = mirror_share(surface, i)
            x, y, z = draw_reflected(surface, i, share, u, v)
            density = reflected_density(surface, i, share, x, y, z)
            row, column = cell_of(tables, x, y, z)
        light[TOWARD, i], light[TOWARD + 1, i], light[TOWARD + 2, i] = x, y, z
        if density > 0:
            for c in range(3):
                light[CARRIED + c, i] = tables.radiance[row, column, c] / density


@njit(nogil=True)
def _most_reflected(surface: Floats, i: int) -> float:  # pragma: no cover - compiled
    """Return about the largest luminance of f n·l: matt, and the mirror at its peak."""
    n_v, matt, mirror = 0.0, 0.0, 0.0
    for axis in range(3):
        n_v += surface[NORMAL + axis, i] * surface[TO_EYE + axis, i]
        matt += surface[MATT + axis, i] / 3
        mirror += surface[F0 + axis, i] / 3
    alpha2 = surface[ALPHA2, i]
    seen = math.sqrt(n_v * n_v * (1 - alpha2) + alpha2)
    return matt + (mirror if surface[F90, i] > 0 else 0.0) * 0.5 / (math.pi * alpha2 * seen)
