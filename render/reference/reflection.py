"""How surfaces reflect: the BRDF of glTF 2.0, as shade.frag has it, and directions drawn by it.

f = (1 − F) ρ / π + D G F / (4 n·l n·v), with the GGX distribution D, Smith's height-correlated G
and Schlick's F. Directions are drawn by the visible normals of D [1]_.

Fails  : light that facets pass on to each other is lost, up to a half at roughness 1.

References
----------
.. [1] E. Heitz, "Sampling the GGX Distribution of Visible Normals", Journal of Computer Graphics
       Techniques 7(4), 2018.
"""

import math

import numpy as np
from numba import njit
from numpy.typing import NDArray

from render.rays.tangent_frame import tangent_frame
from render.reference.surfaces import ALPHA2, NORMAL, TO_EYE

Floats = NDArray[np.float32]


@njit(nogil=True)
def reflected(
    surface: Floats, i: int, x: float, y: float, z: float
) -> tuple[float, float, float]:  # pragma: no cover - compiled
    """Return D G / (4 n·v), (1 − v·h)⁵ and the density of (x, y, z) as `drawn` gives it, per sr.

    The first is the mirror reflection times n·l, but for F. The surface is column `i` of `surface`,
    and (x, y, z) above it.
    """
    ex, ey, ez = surface[TO_EYE, i], surface[TO_EYE + 1, i], surface[TO_EYE + 2, i]
    nx, ny, nz = surface[NORMAL, i], surface[NORMAL + 1, i], surface[NORMAL + 2, i]
    alpha2 = surface[ALPHA2, i]
    hx, hy, hz = ex + x, ey + y, ez + z
    scale = 1 / math.sqrt(hx * hx + hy * hy + hz * hz)
    hx, hy, hz = scale * hx, scale * hy, scale * hz
    n_v = ex * nx + ey * ny + ez * nz
    n_l = x * nx + y * ny + z * nz
    v_h = min(ex * hx + ey * hy + ez * hz, 1.0)
    n_h = nx * hx + ny * hy + nz * hz
    # |n × h|² + α² (n·h)² is the usual (n·h)²(α² − 1) + 1 without its cancellation.
    cx, cy, cz = ny * hz - nz * hy, nz * hx - nx * hz, nx * hy - ny * hx
    spread = cx * cx + cy * cy + cz * cz + alpha2 * n_h * n_h
    distribution = alpha2 / (math.pi * spread * spread)
    seen = math.sqrt(n_v * n_v * (1 - alpha2) + alpha2)
    lit = math.sqrt(n_l * n_l * (1 - alpha2) + alpha2)
    mirror = distribution * 0.5 * n_l / (n_l * seen + n_v * lit)
    c = 1 - v_h
    return mirror, c * c * c * c * c, distribution / (2 * (n_v + seen))


@njit(nogil=True)
def drawn(
    surface: Floats, i: int, u: float, v: float
) -> tuple[float, float, float]:  # pragma: no cover - compiled
    """Return a direction, the view mirrored in a visible normal: u and v are even in [0, 1).

    It may lie below the surface.
    """
    ex, ey, ez = surface[TO_EYE, i], surface[TO_EYE + 1, i], surface[TO_EYE + 2, i]
    nx, ny, nz = surface[NORMAL, i], surface[NORMAL + 1, i], surface[NORMAL + 2, i]
    tx, ty, tz, bx, by, bz = tangent_frame(nx, ny, nz)
    alpha = math.sqrt(surface[ALPHA2, i])

    # The view in the frame, stretched so that facets lie on a sphere.
    vx = alpha * (ex * tx + ey * ty + ez * tz)
    vy = alpha * (ex * bx + ey * by + ez * bz)
    vz = ex * nx + ey * ny + ez * nz
    scale = 1 / math.sqrt(vx * vx + vy * vy + vz * vz)
    vx, vy, vz = scale * vx, scale * vy, scale * vz
    level = math.sqrt(vx * vx + vy * vy)
    px, py = (-vy / level, vx / level) if level > 0 else (1.0, 0.0)
    qx, qy, qz = -vz * py, vz * px, vx * py - vy * px
    radius, turn = math.sqrt(u), 2 * math.pi * v
    p = radius * math.cos(turn)
    half = 0.5 * (1 + vz)
    q = (1 - half) * math.sqrt(max(1 - p * p, 0.0)) + half * radius * math.sin(turn)
    r = math.sqrt(max(1 - p * p - q * q, 0.0))
    mx = alpha * (p * px + q * qx + r * vx)
    my = alpha * (p * py + q * qy + r * vy)
    mz = max(q * qz + r * vz, 1e-9)
    scale = 1 / math.sqrt(mx * mx + my * my + mz * mz)
    mx, my, mz = scale * mx, scale * my, scale * mz

    hx = mx * tx + my * bx + mz * nx
    hy = mx * ty + my * by + mz * ny
    hz = mx * tz + my * bz + mz * nz
    twice = 2 * (ex * hx + ey * hy + ez * hz)
    return twice * hx - ex, twice * hy - ey, twice * hz - ez
