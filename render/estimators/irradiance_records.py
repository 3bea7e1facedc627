"""Irradiance at a place, how it changes with the place and the normal, and where that holds.

A record is measured by rays in strata of the hemisphere, M rings of equal cosine-weighted area by N
sectors. From the light of the strata and the distances at which rays end follow its gradients [2]_.
How far from the place it may be used is told by the nearest thing that a ray meets, or the middle
of all things: the harmonic mean of the distances [1]_ is long in the open, where a box overhead
fills little of the sky.

Cost   : a ray for each stratum, in packets of sixteen.

References
----------
.. [1] G. Ward, F. Rubinstein, R. Clear, "A Ray Tracing Solution for Diffuse Interreflection",
       SIGGRAPH, 1988.
.. [2] G. Ward, P. Heckbert, "Irradiance Gradients", Eurographics Workshop on Rendering, 1992.
"""

import math

import numpy as np
from numba import njit
from numpy.typing import NDArray

from render.estimators.map_tables import MapTables, cell_of
from render.estimators.points import random
from render.rays.embree import PACKET, hit_packet, intersect16
from render.rays.tangent_frame import tangent_frame
from render.reference.surfaces import FAR_M, NORMAL, ORIGIN

_LEAST_RADIUS = 0.03  # of the meshes': records would crowd where things touch

Floats = NDArray[np.float32]
Array = NDArray[np.float64]

PLACE, UPWARD, RADIUS, IRRADIANCE, TURNED, MOVED = 0, 3, 6, 7, 10, 19
FIELDS = 28
"""Of a record, float64: place and normal (3 each), distance of the nearest thing, irradiance (3);
what it gains when the normal is turned about an axis by a small angle, and when the place is moved:
a vector for each of red, green and blue."""


@njit(nogil=True, error_model="numpy")
def measure(
    function: int,
    scene: int,
    lowest: float,
    tables: MapTables,
    rings: int,
    sphere: Floats,
    surface: Floats,
    i: int,
    seed: int,
    record: Array,
) -> None:  # pragma: no cover - compiled
    """Set `record` (FIELDS,) to the irradiance of column `i` of a packet; `function` intersects."""
    sectors = _sectors(rings)
    arrived = np.zeros((rings, sectors, 3))
    near = np.zeros((rings, sectors))  # 1 / distance
    slope = np.zeros((rings, sectors))  # tan θ
    nx, ny, nz = surface[NORMAL, i], surface[NORMAL + 1, i], surface[NORMAL + 2, i]
    frame = np.empty((3, 3))
    frame[0, 0], frame[0, 1], frame[0, 2], frame[1, 0], frame[1, 1], frame[1, 2] = tangent_frame(
        nx, ny, nz
    )
    frame[2] = surface[NORMAL : NORMAL + 3, i]
    rays, valid = hit_packet()
    geometry = rays[18].view(np.int32)
    for first in range(0, rings * sectors, PACKET):
        for r in range(PACKET):
            j, k = divmod(first + r, sectors)
            valid[r] = -np.int32(j < rings)
            if j >= rings:
                continue
            level2 = (j + random(seed, i, 0, first + r)) / rings
            turn = 2 * math.pi * (k + random(seed, i, 1, first + r)) / sectors
            level, up = math.sqrt(level2), math.sqrt(1 - level2)
            slope[j, k] = level / up
            for axis in range(3):
                rays[axis, r] = surface[ORIGIN + axis, i]
                rays[4 + axis, r] = (
                    level * math.cos(turn) * frame[0, axis]
                    + level * math.sin(turn) * frame[1, axis]
                    + up * frame[2, axis]
                )
            rays[3, r], rays[8, r], geometry[r] = 0, FAR_M, -1
        intersect16(function, valid.ctypes.data, scene, rays.ctypes.data)  # type: ignore[call-arg]
        for r in range(PACKET):
            j, k = divmod(first + r, sectors)
            if j >= rings:
                continue
            if geometry[r] != -1:
                near[j, k] = 1 / max(np.float64(rays[8, r]), 1e-9)
            elif rays[5, r] > lowest:
                row, column = cell_of(tables, rays[4, r], rays[5, r], rays[6, r])
                for c in range(3):
                    arrived[j, k, c] = tables.radiance[row, column, c]
    record[:] = 0
    for axis in range(3):
        record[PLACE + axis] = surface[ORIGIN + axis, i]
        record[UPWARD + axis] = surface[NORMAL + axis, i]
    nearest = near.max()
    # What no ray has met may still be there: the meshes lie around the middle of their sphere.
    away2 = 0.0
    for axis in range(3):
        away2 += (sphere[axis] - record[PLACE + axis]) ** 2
    radius_m = min(1 / nearest, math.sqrt(away2)) if nearest > 0 else math.sqrt(away2)
    record[RADIUS] = max(radius_m, _LEAST_RADIUS * sphere[3])
    _add_gradients(arrived, near, slope, frame, record)


@njit(nogil=True)
def _sectors(rings: int) -> int:  # pragma: no cover - compiled
    """Return the number of sectors that makes strata about as wide as high."""
    return int(math.pi * rings + 0.5)


@njit(nogil=True)
def _add_gradients(
    arrived: Array, near: Array, slope: Array, frame: Array, record: Array
) -> None:  # pragma: no cover - compiled
    """Set irradiance and its gradients, as Ward and Heckbert have them [2]_."""
    rings, sectors = near.shape
    part = math.pi / (rings * sectors)
    for k in range(sectors):
        before = (k - 1) % sectors
        middle, edge = 2 * math.pi * (k + 0.5) / sectors, 2 * math.pi * k / sectors
        for j in range(rings):
            inner, outer = math.sqrt(j / rings), math.sqrt((j + 1) / rings)  # sin θ
            for c in range(3):
                light = arrived[j, k, c]
                record[IRRADIANCE + c] += part * light
                # Turned about the horizontal axis a quarter turn ahead.
                turned = part * slope[j, k] * light
                across = (outer - inner) * max(near[j, k], near[j, before])
                across *= light - arrived[j, before, c]
                outward = 0.0
                if j > 0:
                    outward = 2 * math.pi / sectors * inner * (1 - inner * inner)
                    outward *= max(near[j, k], near[j - 1, k]) * (light - arrived[j - 1, k, c])
                for axis in range(3):
                    u, v = frame[0, axis], frame[1, axis]
                    record[TURNED + 3 * c + axis] += turned * (
                        math.cos(middle) * v - math.sin(middle) * u
                    )
                    record[MOVED + 3 * c + axis] += outward * (
                        math.cos(middle) * u + math.sin(middle) * v
                    ) + across * (math.cos(edge) * v - math.sin(edge) * u)


@njit(nogil=True, error_model="numpy")
def fit(record: Array, surface: Floats, i: int) -> float:  # pragma: no cover - compiled
    """Return how well a record fits a surface: 1 over Ward's estimate of its relative error."""
    apart2 = turned = behind = 0.0
    for axis in range(3):
        step = surface[ORIGIN + axis, i] - record[PLACE + axis]
        normal = surface[NORMAL + axis, i]
        apart2 += step * step
        turned += normal * record[UPWARD + axis]
        behind += 0.5 * step * (normal + record[UPWARD + axis])
    if behind < -0.05 * record[RADIUS]:  # what lies in front may hide light from it
        return 0.0
    return 1 / max(math.sqrt(apart2) / record[RADIUS] + math.sqrt(max(1 - turned, 0.0)), 1e-6)


@njit(nogil=True)
def add_irradiance(
    record: Array, weight: float, surface: Floats, i: int, out: Array
) -> None:  # pragma: no cover - compiled
    """Add to `out` (3,) a record's irradiance times a weight, moved and turned to a surface."""
    px, py, pz = record[UPWARD], record[UPWARD + 1], record[UPWARD + 2]
    nx, ny, nz = surface[NORMAL, i], surface[NORMAL + 1, i], surface[NORMAL + 2, i]
    turn = (py * nz - pz * ny, pz * nx - px * nz, px * ny - py * nx)
    for c in range(3):
        irradiance = record[IRRADIANCE + c]
        for axis in range(3):
            irradiance += turn[axis] * record[TURNED + 3 * c + axis]
            step = surface[ORIGIN + axis, i] - record[PLACE + axis]
            irradiance += step * record[MOVED + 3 * c + axis]
        out[c] += weight * max(irradiance, 0.0)
