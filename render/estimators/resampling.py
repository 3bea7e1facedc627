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
from render.estimators.contract import Estimate, Floats, Setting, Shadows
from render.estimators.lobes import mirror_shares
from render.estimators.map_tables import MapTables, map_tables
from render.estimators.points import Points, net, random, shifts_of
from render.estimators.proposals import propose
from render.estimators.shading import (
    CARRIED,
    FIELDS,
    TOWARD,
    add_visible,
    add_waiting,
    luminance_of,
    reflect,
    waiting,
)
from render.rays.embree import PACKET
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
        held = waiting()
        light = np.zeros((FIELDS, PACKET), np.float32)
        shifts, shares = shifts_of(seed, k, 0), mirror_shares(surface)
        kept = np.zeros((FIELDS, PACKET), np.float32)
        total = np.zeros(PACKET, np.float32)
        for group in range(groups):
            # Strided, so that the candidates of each group are spread evenly too.
            members = range(group, len(points), groups)
            kept[:], total[:] = 0, 0
            for s in members:
                propose(tables, by_light, points, s, shifts, shares, surface, light)
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
                kept[row] *= total  # a group stands for its share of all candidates
            traced += add_visible(shadows, surface, kept, held, radiance[k])
        traced += add_waiting(shadows, held, radiance[k])
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
        held = waiting()
        light = np.zeros((FIELDS, PACKET), np.float32)
        shifts, shares = shifts_of(seed, k, 0), mirror_shares(surface)
        most = np.zeros(PACKET)
        for i in range(PACKET):
            reflected = _most_reflected(surface, i) if by_light else 1
            most[i] = brightest * reflected / len(points)
        for s in range(len(points)):
            propose(tables, by_light, points, s, shifts, shares, surface, light)
            reflect(shadows, surface, light)
            for i in range(PACKET):
                weight = luminance_of(light, i)
                is_kept = weight > 0 and random(seed, k, i, s) * most[i] < weight
                scale = max(most[i] / weight, 1) if is_kept else 0
                for row in range(CARRIED, FIELDS):
                    light[row, i] *= scale
            traced += add_visible(shadows, surface, light, held, radiance[k])
        traced += add_waiting(shadows, held, radiance[k])
    return traced


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
