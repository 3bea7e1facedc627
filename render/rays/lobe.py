"""Rays of a mirror lobe, drawn by what a surface passes on: for compiled loops.

References
----------
.. [1] E. Heitz, "Sampling the GGX Distribution of Visible Normals", JCGT 7(4), 2018.
"""

import math

import numpy as np
from numba import njit
from numpy.typing import NDArray

from render.rays.tangent_frame import tangent_frame

_FLOATS = NDArray[np.float32]

_OVERLAP = 0.7
"""What a ray looks up, over the share that it stands for, by solid angle: the pyramid's cells, and
that they are weighed between, widen it."""


def lobe_points(count: int) -> NDArray[np.float64]:
    """Return points (count, 2) of the unit square, spread over it: a golden spiral on the disc."""
    step = np.arange(count) + 0.5
    return np.stack([step / count, step * (3 - math.sqrt(5)) / 2 % 1], axis=-1)


@njit(nogil=True)
def meets(
    part: _FLOATS, i: int, x: float, y: float, z: float, sphere: _FLOATS
) -> bool:  # pragma: no cover - compiled
    """Whether a ray from surface `i` meets a sphere, (x, y, z, radius)."""
    dx, dy, dz = sphere[0] - part[0, i], sphere[1] - part[1, i], sphere[2] - part[2, i]
    along = dx * x + dy * y + dz * z
    off2 = dx * dx + dy * dy + dz * dz - along * along
    return bool(off2 < sphere[3] ** 2 and along > -sphere[3])


@njit(nogil=True)
def lobe_ray(
    part: _FLOATS, i: int, a: float, b: float, count: int
) -> tuple[float, float, float, float, float, float]:  # pragma: no cover - compiled
    """Return one of `count` rays: its direction (x, y, z), G₂/G₁, (1 − v·h)⁵, and sr to look up.

    It is the mirror image of the view in a visible normal, drawn as in [1]_.

    Parameters
    ----------
    part : (≥ 13, 16) float32
        Of 16 surfaces: where rays start (3), shading normal (3), face normal (3), direction to the
        eye (3), α², which is 0 or less where nothing is mirrored.
    i : int
        Which of them.
    a, b : float
        One of `lobe_points`.
    """
    nx, ny, nz = part[3, i], part[4, i], part[5, i]
    tx, ty, tz, bx, by, bz = tangent_frame(nx, ny, nz)
    ex, ey, ez = part[9, i], part[10, i], part[11, i]
    vx, vy = ex * tx + ey * ty + ez * tz, ex * bx + ey * by + ez * bz
    vz = max(ex * nx + ey * ny + ez * nz, 1e-4)
    alpha2 = max(part[12, i], 1e-12)
    alpha = math.sqrt(alpha2)

    sx, sy, sz = alpha * vx, alpha * vy, vz
    length = math.sqrt(sx * sx + sy * sy + sz * sz)
    sx, sy, sz = sx / length, sy / length, sz / length
    across = math.sqrt(sx * sx + sy * sy)
    ux, uy = (-sy / across, sx / across) if across > 1e-7 else (1.0, 0.0)
    wx, wy, wz = -sz * uy, sz * ux, sx * uy - sy * ux
    radius, turn = math.sqrt(a), 2 * math.pi * b
    t1 = radius * math.cos(turn)
    s = 0.5 * (1 + sz)
    t2 = (1 - s) * math.sqrt(max(1 - t1 * t1, 0.0)) + s * radius * math.sin(turn)
    t3 = math.sqrt(max(1 - t1 * t1 - t2 * t2, 0.0))
    hx = alpha * (t1 * ux + t2 * wx + t3 * sx)
    hy = alpha * (t1 * uy + t2 * wy + t3 * sy)
    hz = max(t2 * wz + t3 * sz, 1e-9)
    length = math.sqrt(hx * hx + hy * hy + hz * hz)
    hx, hy, hz = hx / length, hy / length, hz / length

    v_h = vx * hx + vy * hy + vz * hz
    lx, ly, lz = 2 * v_h * hx - vx, 2 * v_h * hy - vy, 2 * v_h * hz - vz
    x = lx * tx + ly * bx + lz * nx
    y = lx * ty + ly * by + lz * ny
    z = lx * tz + ly * bz + lz * nz
    facing = x * part[6, i] + y * part[7, i] + z * part[8, i]
    g_v = math.sqrt(alpha2 + (1 - alpha2) * vz * vz)
    spread = (hx * hx + hy * hy) + alpha2 * hz * hz
    density = alpha2 / (math.pi * spread * spread) / (2 * (vz + g_v))  # D G₁ / (4 n·v)
    share = _OVERLAP / (count * density)
    if part[12, i] <= 0 or lz <= 0 or facing <= 0:
        return x, y, z, 0.0, 0.0, share
    g_l = math.sqrt(alpha2 + (1 - alpha2) * lz * lz)
    return x, y, z, lz * (vz + g_v) / (vz * g_l + lz * g_v), (1 - v_h) ** 5, share
