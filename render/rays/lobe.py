"""Rays of a mirror lobe, drawn by what a surface passes on: for compiled loops.

References
----------
.. [1] E. Heitz, "Sampling the GGX Distribution of Visible Normals", JCGT 7(4), 2018.
"""

import math

import numpy as np
from numba import njit
from numpy.typing import NDArray

from render.loose_arithmetic import LOOSE
from render.rays.embree import PACKET
from render.rays.tangent_frame import tangent_frame

_FLOATS = NDArray[np.float32]


_ROW = tuple(np.uint64(PACKET * row) for row in range(13))

_OVERLAP = 0.7
"""What a ray looks up, over the share that it stands for, by solid angle: the pyramid's cells, and
that they are weighed between, widen it."""


def lobe_points(count: int) -> NDArray[np.float64]:
    """Return points (count, 2) of the unit square, spread over it: a golden spiral on the disc."""
    step = np.arange(count) + 0.5
    return np.stack([step / count, step * (3 - math.sqrt(5)) / 2 % 1], axis=-1)


def on_disc(points: NDArray[np.float64]) -> _FLOATS:
    """Return points (…, 2) as `lobe_rays` takes them: on the unit disc, and half its chord there.

    (…, 3): aside, up, and how far up the disc reaches at `aside`.
    """
    radius, turn = np.sqrt(points[..., 0]), 2 * math.pi * points[..., 1]
    aside = radius * np.cos(turn)
    half_chord = np.sqrt(np.maximum(1 - aside**2, 0))
    return np.stack([aside, radius * np.sin(turn), half_chord], axis=-1).astype(np.float32)


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


@njit(nogil=True, fastmath=LOOSE, error_model="numpy")
def lobe_rays(
    part: _FLOATS,
    points: _FLOATS,
    count: int,
    sphere: _FLOATS,
    rays: _FLOATS,
    valid: NDArray[np.int32],
    passed: _FLOATS,
) -> None:  # pragma: no cover - compiled
    """Aim a packet of `rays` as `lobe_ray` does each, and mark those that meet a sphere.

    `points` (3, 16) are each surface's own, as `on_disc` has them. `passed` (3, 16) is set to
    G₂/G₁, (1 − v·h)⁵ and sr to look up. All is float32, and vectorised.
    """
    zero, one, two = np.float32(0), np.float32(1), np.float32(2)
    full_share = np.float32(_OVERLAP * 2 * math.pi / count)
    # Rows a known way apart in a line, or the loop is not vectorised for fear of overlaps.
    surface, ray, out = part.reshape(-1), rays.reshape(-1), passed.reshape(-1)
    point = points.reshape(-1)
    for i in range(np.uint64(PACKET)):
        t1, up, half_chord = point[_ROW[0] + i], point[_ROW[1] + i], point[_ROW[2] + i]
        nx, ny, nz = surface[_ROW[3] + i], surface[_ROW[4] + i], surface[_ROW[5] + i]
        sign = one if nz >= 0 else -one
        c = -one / (sign + nz)
        d = nx * ny * c
        tx, ty, tz = one + sign * nx * nx * c, sign * d, -sign * nx
        bx, by, bz = d, sign + ny * ny * c, -ny
        ex, ey, ez = surface[_ROW[9] + i], surface[_ROW[10] + i], surface[_ROW[11] + i]
        vx, vy = ex * tx + ey * ty + ez * tz, ex * bx + ey * by + ez * bz
        vz = max(ex * nx + ey * ny + ez * nz, np.float32(1e-4))
        alpha2 = max(surface[_ROW[12] + i], np.float32(1e-10))
        alpha = np.float32(math.sqrt(alpha2))

        sx, sy, sz = alpha * vx, alpha * vy, vz
        scale = one / np.float32(math.sqrt(sx * sx + sy * sy + sz * sz))
        sx, sy, sz = sx * scale, sy * scale, sz * scale
        across = np.float32(math.sqrt(sx * sx + sy * sy))
        is_slanted = across > np.float32(1e-7)
        scale = one / max(across, np.float32(1e-7))
        ux = -sy * scale if is_slanted else one
        uy = sx * scale if is_slanted else zero
        s = np.float32(0.5) * (one + sz)
        t2 = (one - s) * half_chord + s * up
        t3 = np.float32(math.sqrt(max(one - t1 * t1 - t2 * t2, zero)))
        hx = alpha * (t1 * ux - t2 * sz * uy + t3 * sx)
        hy = alpha * (t1 * uy + t2 * sz * ux + t3 * sy)
        hz = max(t2 * (sx * uy - sy * ux) + t3 * sz, np.float32(1e-9))
        scale = one / np.float32(math.sqrt(hx * hx + hy * hy + hz * hz))
        hx, hy, hz = hx * scale, hy * scale, hz * scale

        v_h = vx * hx + vy * hy + vz * hz
        lx, ly, lz = two * v_h * hx - vx, two * v_h * hy - vy, two * v_h * hz - vz
        x = lx * tx + ly * bx + lz * nx
        y = lx * ty + ly * by + lz * ny
        z = lx * tz + ly * bz + lz * nz
        facing = x * surface[_ROW[6] + i] + y * surface[_ROW[7] + i] + z * surface[_ROW[8] + i]
        g_v = np.float32(math.sqrt(alpha2 + (one - alpha2) * vz * vz))
        spread = hx * hx + hy * hy + alpha2 * hz * hz
        g_l = np.float32(math.sqrt(alpha2 + (one - alpha2) * lz * lz))
        is_seen = (surface[_ROW[12] + i] > 0) & (lz > 0) & (facing > 0)
        shadowed = lz * (vz + g_v) / (vz * g_l + lz * g_v)
        left = one - v_h
        out[_ROW[0] + i] = shadowed if is_seen else zero
        out[_ROW[1] + i] = left * left * left * left * left
        out[_ROW[2] + i] = full_share * spread * spread * (vz + g_v) / alpha2
        dx, dy, dz = (
            sphere[0] - surface[_ROW[0] + i],
            sphere[1] - surface[_ROW[1] + i],
            sphere[2] - surface[_ROW[2] + i],
        )
        along = dx * x + dy * y + dz * z
        off2 = dx * dx + dy * dy + dz * dz - along * along
        meets = (off2 < sphere[3] * sphere[3]) & (along > -sphere[3])
        ray[_ROW[4] + i], ray[_ROW[5] + i], ray[_ROW[6] + i] = x, y, z
        valid[i] = -np.int32(is_seen & meets)
