"""Directions drawn by how a surface reflects: its cosine, and its mirror's visible normals.

What is drawn from is (1 − q) n·l/π + q p, with the density p of GGX's visible normals
(reference/reflection.py) and q about the share that the mirror has in what the surface reflects. A
small and bright source is met too rarely: the sun by one direction in a hundred thousand.

References
----------
.. [1] P. Debevec, "Image-Based Lighting", IEEE Computer Graphics and Applications 22(2), 2002.
"""

import math
from functools import partial

import numpy as np
from numba import njit, prange

from render.estimators.contract import Estimate, Floats, Setting, Shadows
from render.estimators.map_tables import MapTables, cell_of, map_tables
from render.estimators.points import Points, net, shift_of, shifted
from render.estimators.shading import CARRIED, FIELDS, TOWARD, add_visible, reflect, start_at
from render.rays.embree import PACKET, packet
from render.rays.tangent_frame import tangent_frame
from render.reference.reflection import drawn, reflected
from render.reference.surfaces import F0, F90, HIT, MATT, NORMAL, TO_EYE


def cosine(setting: Setting) -> Estimate:
    """Prepare to draw by the cosine alone, whatever the surface mirrors."""
    return partial(_estimate, setting.shadows, map_tables(setting.environment), False)


def brdf(setting: Setting) -> Estimate:
    """Prepare to draw by the cosine and the mirror."""
    return partial(_estimate, setting.shadows, map_tables(setting.environment), True)


def _estimate(
    shadows: Shadows,
    tables: MapTables,
    has_lobe: bool,
    surfaces: Floats,
    samples: int,
    seed: int,
    radiance: Floats,
) -> int:
    return int(_add(shadows, tables, has_lobe, surfaces, net(samples), seed, radiance))


@njit(cache=True, nogil=True, parallel=True)
def _add(
    shadows: Shadows,
    tables: MapTables,
    has_lobe: bool,
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
        share = np.zeros(PACKET)
        for i in range(PACKET):
            share[i] = mirror_share(surface, i) if has_lobe else 0.0
        for s in range(len(points)):
            for i in range(PACKET):
                light[CARRIED : CARRIED + 3, i] = 0
                if surface[HIT, i] == 0:
                    continue
                u, v = shifted(points, s, shift_of(seed, k, i))
                x, y, z = draw_reflected(surface, i, share[i], u, v)
                light[TOWARD, i], light[TOWARD + 1, i], light[TOWARD + 2, i] = x, y, z
                density = reflected_density(surface, i, share[i], x, y, z)
                if density > 0:
                    row, column = cell_of(tables, x, y, z)
                    for c in range(3):
                        arriving = tables.radiance[row, column, c]
                        light[CARRIED + c, i] = arriving / (density * len(points))
            reflect(shadows, surface, light)
            traced += add_visible(shadows, surface, light, shadow, radiance[k])
    return traced


@njit(nogil=True)
def mirror_share(surface: Floats, i: int) -> float:  # pragma: no cover - compiled
    """Return how much of the directions of a surface its mirror should draw."""
    if surface[F90, i] == 0:
        return 0.0
    n_v = 0.0
    for axis in range(3):
        n_v += surface[NORMAL + axis, i] * surface[TO_EYE + axis, i]
    grazing = (1 - min(n_v, 1.0)) ** 5
    mirror = matt = 0.0
    for c in range(3):
        fresnel = surface[F0 + c, i] + (surface[F90, i] - surface[F0 + c, i]) * grazing
        mirror += fresnel
        matt += (1 - fresnel) * surface[MATT + c, i] * math.pi
    return mirror / (mirror + matt) if mirror > 0 else 0.0


@njit(nogil=True)
def draw_reflected(
    surface: Floats, i: int, share: float, u: float, v: float
) -> tuple[float, float, float]:  # pragma: no cover - compiled
    """Return a direction of density `reflected_density`, for (u, v) even in [0, 1)².

    It may lie below the surface.
    """
    if u < share:
        return drawn(surface, i, u / share, v)
    u = (u - share) / (1 - share)
    nx, ny, nz = surface[NORMAL, i], surface[NORMAL + 1, i], surface[NORMAL + 2, i]
    tx, ty, tz, bx, by, bz = tangent_frame(nx, ny, nz)
    level, turn = math.sqrt(u), 2 * math.pi * v
    x, y, up = level * math.cos(turn), level * math.sin(turn), math.sqrt(1 - u)
    return x * tx + y * bx + up * nx, x * ty + y * by + up * ny, x * tz + y * bz + up * nz


@njit(nogil=True)
def reflected_density(
    surface: Floats, i: int, share: float, x: float, y: float, z: float
) -> float:  # pragma: no cover - compiled
    """Return the density of `draw_reflected` at (x, y, z), per sr; 0 below the surface."""
    n_l = surface[NORMAL, i] * x + surface[NORMAL + 1, i] * y + surface[NORMAL + 2, i] * z
    if n_l <= 0:
        return 0.0
    density = (1 - share) * n_l / math.pi
    if share > 0:
        density += share * reflected(surface, i, x, y, z)[2]
    return density
